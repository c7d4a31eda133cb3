/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/* Event text: whatever is in the file, events come out on the sensor and in order, and every line is accounted for. */
#include "events_text.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    enum { CAP = 64, W = 240, H = 180 };
    static evs_event_t ev[CAP];
    static int64_t t_us[CAP];
    evh_error_t err = {""};
    evh_event_source_t *const source = evh_events_text_open(fuzz_file(data, size), W, H, &err);
    int64_t last_us = INT64_MIN;
    uint64_t n = 0u;
    ssize_t got;
    FUZZ_CHECK(source != NULL);
    while ((got = source->read(source, ev, t_us, CAP, &err)) > 0) {
        FUZZ_CHECK(got <= CAP);
        for (ssize_t i = 0; i < got; i++) {
            FUZZ_CHECK((evs_event_x_px(ev[i]) < W) && (evs_event_y_px(ev[i]) < H));
            FUZZ_CHECK(t_us[i] >= last_us);
            FUZZ_CHECK(ev[i].t_us == (uint32_t)(uint64_t)t_us[i]);
            last_us = t_us[i];
        }
        n += (uint64_t)got;
    }
    FUZZ_CHECK(n == source->tally.n_good);
    FUZZ_CHECK((got == 0) == (err.text[0] == '\0'));
    source->close(source);
    return 0;
}
