/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#include "options.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "command.h"
#include "decimal.h"

#define HELP_COLUMN 30

static void print_option(const evt_option_t *o)
{
    const char *text = o->help;
    char left[64];
    (void)snprintf(left, sizeof left, "  --%s%s%s", o->name, (o->value_name != NULL) ? " " : "",
                   (o->value_name != NULL) ? o->value_name : "");
    if (o->short_name != '\0') {
        (void)snprintf(left, sizeof left, "  -%c, --%s%s%s", o->short_name, o->name, (o->value_name != NULL) ? " " : "",
                       (o->value_name != NULL) ? o->value_name : "");
    }
    (void)printf("%-*s", HELP_COLUMN, left);
    if (strlen(left) >= HELP_COLUMN) { (void)printf("\n%*s", HELP_COLUMN, ""); }
    for (;;) {
        const size_t length = strcspn(text, "\n");
        (void)printf("%.*s\n", (int)length, text);
        if (text[length] == '\0') { break; }
        text += length + 1u;
        (void)printf("%*s", HELP_COLUMN, "");
    }
}

static void print_help(const evt_usage_t *usage)
{
    (void)printf("Usage: evstab %s %s\n\n%s\n\nOptions:\n", usage->command, usage->synopsis, usage->about);
    for (size_t i = 0u; i < usage->n_options; i++) { print_option(&usage->options[i]); }
    (void)printf("%-*s%s\n", HELP_COLUMN, "  -h, --help", "This text.");
    if (usage->examples != NULL) { (void)printf("\nExamples:\n%s\n", usage->examples); }
    (void)printf("\nExit status: 0 done, 1 bad input or a failed run, 2 wrong usage.\n");
}

int evt_usage_error(const evt_usage_t *usage, const char *format, ...)
{
    va_list args;
    (void)fprintf(stderr, "evstab %s: ", usage->command);
    va_start(args, format);
    (void)vfprintf(stderr, format, args);
    va_end(args);
    (void)fprintf(stderr, "; see 'evstab %s --help'\n", usage->command);
    return EVT_EXIT_USAGE;
}

/* The option that an argument names; *value is the text after '=' or NULL. */
static const evt_option_t *find(const evt_usage_t *usage, const char *arg, const char **value)
{
    *value = NULL;
    if ((arg[0] == '-') && (arg[1] == '-')) {
        const char *const name = arg + 2;
        const size_t length = strcspn(name, "=");
        if (name[length] == '=') { *value = name + length + 1u; }
        for (size_t i = 0u; i < usage->n_options; i++) {
            const char *const known = usage->options[i].name;
            if ((strlen(known) == length) && (memcmp(known, name, length) == 0)) { return &usage->options[i]; }
        }
        return NULL;
    }
    for (size_t i = 0u; i < usage->n_options; i++) {
        if ((usage->options[i].short_name != '\0') && (usage->options[i].short_name == arg[1])) {
            if (arg[2] != '\0') { *value = arg + 2; }
            return &usage->options[i];
        }
    }
    return NULL;
}

static bool take_option(const evt_usage_t *usage, int argc, char **argv, int *i, int *status)
{
    const char *const arg = argv[*i];
    const char *value = NULL;
    const evt_option_t *const option = find(usage, arg, &value);
    if (option == NULL) {
        *status = evt_usage_error(usage, "unknown option '%s'", arg);
        return false;
    }
    if (option->value_name == NULL) {
        if (value != NULL) {
            *status = evt_usage_error(usage, "--%s takes no value", option->name);
            return false;
        }
        *option->flag = true;
        return true;
    }
    if (value == NULL) {
        if (*i + 1 >= argc) {
            *status = evt_usage_error(usage, "--%s needs a value: %s", option->name, option->value_name);
            return false;
        }
        *i += 1;
        value = argv[*i];
    }
    if (value[0] == '\0') {
        *status = evt_usage_error(usage, "--%s needs a value: %s", option->name, option->value_name);
        return false;
    }
    if (*option->value != NULL) {
        *status = evt_usage_error(usage, "--%s is given twice", option->name);
        return false;
    }
    *option->value = value;
    return true;
}

bool evt_options_parse(const evt_usage_t *usage, int argc, char **argv, const char **words, int *status)
{
    size_t n_words = 0u;
    bool options_end = false;
    for (size_t i = 0u; i < usage->n_words_max; i++) { words[i] = NULL; }
    for (int i = 1; i < argc; i++) {
        if (!options_end && ((strcmp(argv[i], "--help") == 0) || (strcmp(argv[i], "-h") == 0))) {
            print_help(usage);
            *status = EVT_EXIT_OK;
            return false;
        }
        if (strcmp(argv[i], "--") == 0) { options_end = true; }
    }
    options_end = false;
    for (int i = 1; i < argc; i++) {
        if (!options_end && (strcmp(argv[i], "--") == 0)) {
            options_end = true;
        } else if (!options_end && (argv[i][0] == '-') && (argv[i][1] != '\0')) {
            if (!take_option(usage, argc, argv, &i, status)) { return false; }
        } else if (n_words == usage->n_words_max) {
            *status = evt_usage_error(usage, "one word too many: '%s'", argv[i]);
            return false;
        } else {
            words[n_words++] = argv[i];
        }
    }
    if (n_words < usage->n_words_min) {
        *status = evt_usage_error(usage, "something is missing; usage: evstab %s %s", usage->command, usage->synopsis);
        return false;
    }
    return true;
}

bool evt_parse_int(const char *text, int64_t low, int64_t high, int64_t *value)
{
    const char *const end = text + strlen(text);
    bool exact = false;
    return evh_decimal_parse(&text, end, 0, value, &exact) && (text == end) && exact && (*value >= low) &&
           (*value <= high);
}

bool evt_parse_seconds(const char *text, int64_t *t_us)
{
    const char *const end = text + strlen(text);
    return evh_decimal_parse(&text, end, 6, t_us, NULL) && (text == end);
}

bool evt_parse_size(const char *text, uint16_t *width, uint16_t *height)
{
    const char *const end = text + strlen(text);
    int64_t w = 0;
    int64_t h = 0;
    if (!evh_decimal_parse(&text, end, 0, &w, NULL) || (text == end) || ((*text != 'x') && (*text != 'X'))) {
        return false;
    }
    text++;
    if (!evh_decimal_parse(&text, end, 0, &h, NULL) || (text != end)) { return false; }
    if ((w < 1) || (h < 1) || (w > 2048) || (h > 2048)) { return false; }
    *width = (uint16_t)w;
    *height = (uint16_t)h;
    return true;
}

bool evt_parse_on_off(const char *text, bool *on)
{
    *on = (strcmp(text, "on") == 0);
    return *on || (strcmp(text, "off") == 0);
}
