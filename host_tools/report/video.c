/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "video.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "panes.h"

#define PICTURE_US 20000 /* Shown for 40 ms: half speed, slow enough to see the shaking. */
#define FPS        "25"
#define PAUSE_MAX  50 /* Pictures without an event, at most, in a pause of the recording. */
#define GAP        2  /* Between panes; even, as mp4 wants widths to be. */

extern char **environ;

struct evr_video {
    evr_panes_t panes;
    char *path;
    pid_t pid;
    int pipe;
    int failure;     /* errno of the first failed write */
    evh_error_t err; /* or why ffmpeg did not start */
    bool started;
    int64_t start_us;
    bool has_start;
    bool dirty;
    uint8_t *picture;
    uint8_t *rgb;
    int width, height; /* of the video */
    struct sigaction old_pipe_action;
};

static bool ends_with(const char *text, const char *end)
{
    const size_t n = strlen(text);
    const size_t m = strlen(end);
    return (n > m) && (strcmp(text + n - m, end) == 0);
}

static bool in_path(const char *program)
{
    const char *dir = getenv("PATH");
    while ((dir != NULL) && (*dir != '\0')) {
        const size_t n = strcspn(dir, ":");
        char file[4096];
        if ((snprintf(file, sizeof file, "%.*s/%s", (int)n, dir, program) < (int)sizeof file) &&
            (access(file, X_OK) == 0)) {
            return true;
        }
        dir += n + ((dir[n] == ':') ? 1u : 0u);
    }
    return false;
}

bool evr_video_name_ok(const char *path) { return ends_with(path, ".mp4") || ends_with(path, ".gif"); }

bool evr_video_possible(const char *path, evh_error_t *err)
{
    if (!in_path("ffmpeg")) {
        return evh_fail(err, "%s: needs the program ffmpeg, which is not installed (apt-get install ffmpeg)", path);
    }
    return true;
}

static char *file_url(const char *path)
{
    const size_t n = strlen(path) + 6u;
    char *const url = malloc(n);
    if (url != NULL) { (void)snprintf(url, n, "file:%s", path); }
    return url;
}

/* ffmpeg with our pipe as its input. The arguments go to it as they are, past any shell; "file:" keeps a name that
 * begins with a dash or holds a colon from meaning something else. */
static bool spawn(evr_video_t *v, evh_error_t *err)
{
    char size[32];
    char filter[160];
    char *const url = file_url(v->path);
    const bool gif = ends_with(v->path, ".gif");
    const char *const mp4_args[] = {"-pix_fmt", "yuv420p", "-movflags", "+faststart", NULL};
    const char *const head[] = {"ffmpeg",   "-nostdin", "-loglevel", "error",       "-y",   "-f",
                                "rawvideo", "-pix_fmt", "rgb24",     "-video_size", size,   "-framerate",
                                FPS,        "-i",       "pipe:0",    "-vf",         filter, NULL};
    const char *args[40];
    size_t n = 0u;
    int ends[2];
    int status;
    posix_spawn_file_actions_t actions;
    const int scale = (v->width <= 800) ? 2 : 1; /* Small sensors are shown at twice their size, pixel by pixel. */

    (void)snprintf(size, sizeof size, "%dx%d", v->width, v->height);
    (void)snprintf(filter, sizeof filter, "scale=iw*%d:ih*%d:flags=neighbor%s", scale, scale,
                   gif ? ",split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none" : "");
    for (size_t i = 0u; head[i] != NULL; i++) { args[n++] = head[i]; }
    for (size_t i = 0u; !gif && (mp4_args[i] != NULL); i++) { args[n++] = mp4_args[i]; }
    args[n++] = url;
    args[n] = NULL;
    if (url == NULL) { return evh_fail(err, "%s: out of memory", v->path); }
    if (pipe(ends) != 0) {
        free(url);
        return evh_fail(err, "%s: no pipe to ffmpeg: %s", v->path, strerror(errno));
    }
    (void)fcntl(ends[1], F_SETFD, FD_CLOEXEC); /* Else ffmpeg would wait for itself to close it. */
    (void)posix_spawn_file_actions_init(&actions);
    (void)posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    (void)posix_spawn_file_actions_addclose(&actions, ends[0]);
    (void)posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    {
        char *argv[40]; /* posix_spawn writes to none of them, whatever its type says. */
        for (size_t i = 0u; i <= n; i++) { memcpy(&argv[i], &args[i], sizeof argv[i]); }
        status = posix_spawnp(&v->pid, "ffmpeg", &actions, NULL, argv, environ);
    }
    (void)posix_spawn_file_actions_destroy(&actions);
    (void)close(ends[0]);
    free(url);
    if (status != 0) {
        (void)close(ends[1]);
        v->pid = 0;
        return evh_fail(err, "%s: cannot start ffmpeg: %s", v->path, strerror(status));
    }
    v->pipe = ends[1];
    return true;
}

static void free_all(evr_video_t *v)
{
    free(v->path);
    free(v->picture);
    free(v->rgb);
    free(v);
}

evr_video_t *evr_video_open(const char *path, uint16_t width_px, uint16_t height_px, evh_error_t *err)
{
    evr_video_t *const v = calloc(1u, sizeof *v);
    if (v == NULL) {
        (void)evh_fail(err, "%s: out of memory", path);
        return NULL;
    }
    v->panes = evr_panes_layout(width_px, height_px);
    v->width = (3 * v->panes.width + GAP + 1) & ~1;
    v->height = 2 * v->panes.height + GAP;
    v->path = strdup(path);
    v->picture = calloc(1u, v->panes.n_cells);
    v->rgb = malloc((size_t)v->width * (size_t)v->height * 3u);
    if ((v->path == NULL) || (v->picture == NULL) || (v->rgb == NULL)) {
        (void)evh_fail(err, "%s: out of memory", path);
        free_all(v);
        return NULL;
    }
    return v;
}

/* With the first event, so that a run without any leaves no file behind. */
static void start(evr_video_t *v)
{
    struct sigaction ignore;
    v->started = true;
    if (!spawn(v, &v->err)) { return; }
    /* When ffmpeg gives up, a write shall fail and be reported, not end this program. */
    memset(&ignore, 0, sizeof ignore);
    ignore.sa_handler = SIG_IGN;
    (void)sigaction(SIGPIPE, &ignore, &v->old_pipe_action);
}

/* Brighter events blue, darker ones orange, on near black; more events, more light. */
static void colour(uint8_t cell, uint8_t rgb[3])
{
    static const double BRIGHTER[3] = {110.0, 185.0, 255.0};
    static const double DARKER[3] = {255.0, 150.0, 85.0};
    static const uint8_t GROUND[3] = {13, 17, 23};
    static const double LIGHT[9] = {0.0, 0.42, 0.62, 0.75, 0.84, 0.9, 0.95, 0.98, 1.0};
    const unsigned n_brighter = cell & 15u;
    const unsigned n_darker = cell >> 4;
    const unsigned n = n_brighter + n_darker;
    const double light = LIGHT[(n < 8u) ? n : 8u];
    const double share = (n > 0u) ? (double)n_brighter / n : 0.0;
    for (int i = 0; i < 3; i++) {
        const double full = share * BRIGHTER[i] + (1.0 - share) * DARKER[i];
        rgb[i] = (uint8_t)(GROUND[i] + light * (full - GROUND[i]) + 0.5);
    }
}

static void paint(evr_video_t *v, const uint8_t *cells, int stride, int width, int height, int left, int top)
{
    for (int y = 0; y < height; y++) {
        uint8_t *to = v->rgb + 3u * ((size_t)(top + y) * (size_t)v->width + (size_t)left);
        for (int x = 0; x < width; x++) { colour(cells[y * stride + x], to + 3 * x); }
    }
}

static void write_all(evr_video_t *v, const uint8_t *bytes, size_t n)
{
    while ((n > 0u) && (v->failure == 0)) {
        const ssize_t done = write(v->pipe, bytes, n);
        if (done >= 0) {
            bytes += done;
            n -= (size_t)done;
        } else if (errno != EINTR) {
            v->failure = errno;
        }
    }
}

static void send_picture(evr_video_t *v)
{
    const evr_panes_t *const p = &v->panes;
    const uint8_t *const canvas = v->picture + evr_panes_canvas_at(p);
    memset(v->rgb, 96, (size_t)v->width * (size_t)v->height * 3u);
    paint(v, v->picture, p->width, p->width, p->height, 0, 0);
    /* The stabilized pane is the middle of the canvas. */
    paint(v, canvas + (p->height / 2) * 2 * p->width + p->width / 2, 2 * p->width, p->width, p->height, 0,
          p->height + GAP);
    paint(v, canvas, 2 * p->width, 2 * p->width, 2 * p->height, p->width + GAP, GAP / 2);
    write_all(v, v->rgb, (size_t)v->width * (size_t)v->height * 3u);
    memset(v->picture, 0, p->n_cells);
}

/* Go on to the picture that holds t_us. */
static void advance_to(evr_video_t *v, int64_t t_us)
{
    int sent = 0;
    if (!v->has_start || (t_us < v->start_us)) { /* The beginning, or a restarted clock. */
        v->has_start = true;
        v->start_us = t_us;
    }
    while ((t_us - v->start_us >= PICTURE_US) && (sent < PAUSE_MAX)) {
        send_picture(v);
        v->start_us += PICTURE_US;
        sent++;
    }
    if (t_us - v->start_us >= PICTURE_US) { v->start_us = t_us; }
}

void evr_video_add(evr_video_t *v, const int64_t *t_us, const evs_event_t *ev, const evs_point_t *undistorted,
                   const evs_point_t *stabilized, size_t n)
{
    size_t i = 0u;
    if (!v->started && (n > 0u)) { start(v); }
    if ((v->pid == 0) || (v->failure != 0)) { return; }
    while (i < n) {
        size_t end = i + 1u;
        advance_to(v, t_us[i]);
        while ((end < n) && (t_us[end] >= v->start_us) && (t_us[end] - v->start_us < PICTURE_US)) { end++; }
        evr_panes_add(&v->panes, v->picture, ev + i, undistorted + i, stabilized + i, end - i);
        v->dirty = true;
        i = end;
    }
}

bool evr_video_close(evr_video_t *v, evh_error_t *err)
{
    int status = 0;
    bool ok = true;
    if (v == NULL) { return true; }
    if (v->pid == 0) {
        ok = !v->started || evh_fail(err, "%s", v->err.text);
        free_all(v);
        return ok;
    }
    if (v->dirty) { send_picture(v); }
    (void)close(v->pipe);
    while ((waitpid(v->pid, &status, 0) < 0) && (errno == EINTR)) {}
    (void)sigaction(SIGPIPE, &v->old_pipe_action, NULL);
    if (!WIFEXITED(status) || (WEXITSTATUS(status) != 0)) {
        ok = evh_fail(err, "%s: ffmpeg failed; it says why above", v->path);
    } else if (v->failure != 0) {
        ok = evh_fail(err, "%s: cannot write to ffmpeg: %s", v->path, strerror(v->failure));
    }
    free_all(v);
    return ok;
}
