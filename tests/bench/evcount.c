/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/*
 * A plugin for QEMU that counts the instructions between markers (bench_markers.h) of a bare-metal program. The counts
 * are exact and the same in every run: QEMU executes, it does not sample. They are not cycles: no caches, no wait
 * states, no dual issue.
 *
 *   qemu-system-arm -plugin libevcount.so,out=counts.txt ...
 *
 * writes one line per region when QEMU ends: "region <id> calls <n> instructions <n>", the markers not counted.
 *
 * QEMU ships no header for plugins in Debian, hence the declarations below: those that we use, of interface version 1
 * (QEMU 6.0 to 8.2). QEMU 9 moved to another version, and refuses ours with a message that says so.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLUGIN_INTERFACE_VERSION 1

typedef uint64_t plugin_id_t;
typedef struct plugin_tb plugin_tb_t;     /* A block of instructions that QEMU translates at once. */
typedef struct plugin_insn plugin_insn_t; /* One of them. */

enum { CALLBACK_READS_NO_REGISTERS = 0, INLINE_ADD_U64 = 0 };

int qemu_plugin_install(plugin_id_t id, const void *info, int argc, char **argv);
void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id_t id, void (*f)(plugin_id_t, plugin_tb_t *));
void qemu_plugin_register_atexit_cb(plugin_id_t id, void (*f)(plugin_id_t, void *), void *user);
void qemu_plugin_register_vcpu_insn_exec_cb(plugin_insn_t *insn, void (*f)(unsigned, void *), int flags, void *user);
void qemu_plugin_register_vcpu_insn_exec_inline(plugin_insn_t *insn, int operation, void *number, uint64_t addend);
size_t qemu_plugin_tb_n_insns(const plugin_tb_t *tb);
plugin_insn_t *qemu_plugin_tb_get_insn(const plugin_tb_t *tb, size_t i);
const void *qemu_plugin_insn_data(const plugin_insn_t *insn);
size_t qemu_plugin_insn_size(const plugin_insn_t *insn);

__attribute__((visibility("default"))) int qemu_plugin_version = PLUGIN_INTERFACE_VERSION;

enum { REGIONS = 32, PATH_BYTES = 1024 };

typedef struct {
    uint64_t n_calls;
    uint64_t n_insns;
    uint64_t at_start; /* n_executed when the region was entered. */
} region_t;

static region_t regions[REGIONS];
static uint64_t n_executed; /* Instructions so far, markers left out; QEMU's generated code adds to it. */
static char out_path[PATH_BYTES];

static void on_start(unsigned cpu, void *user)
{
    (void)cpu;
    ((region_t *)user)->at_start = n_executed;
}

static void on_stop(unsigned cpu, void *user)
{
    region_t *const region = user;
    (void)cpu;
    region->n_insns += n_executed - region->at_start;
    region->n_calls++;
}

/* The marker's number, 0..31 for start and 32..63 for stop; -1 if the instruction is none. */
static int marker_number(const plugin_insn_t *insn)
{
    const unsigned char *const b = qemu_plugin_insn_data(insn);
    if (qemu_plugin_insn_size(insn) != 4u) { return -1; }
    /* Thumb "hint.w #0x40 + number": f3af 8040 + number, halfwords with the low byte first. */
    if ((b[0] == 0xAFu) && (b[1] == 0xF3u) && (b[3] == 0x80u) && (b[2] >= 0x40u) && (b[2] < 0x80u)) {
        return b[2] - 0x40;
    }
    /* RISC-V "addi x0, x0, 0x400 + number": 40000013 + (number << 20). */
    const uint32_t word = (uint32_t)b[0] | ((uint32_t)b[1] << 8) | ((uint32_t)b[2] << 16) | ((uint32_t)b[3] << 24);
    return ((word & 0xFC0FFFFFu) == 0x40000013u) ? (int)((word >> 20) & 0x3Fu) : -1;
}

static void on_translate(plugin_id_t id, plugin_tb_t *tb)
{
    (void)id;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(tb); i++) {
        plugin_insn_t *const insn = qemu_plugin_tb_get_insn(tb, i);
        const int number = marker_number(insn);
        if (number < 0) {
            qemu_plugin_register_vcpu_insn_exec_inline(insn, INLINE_ADD_U64, &n_executed, 1u);
        } else {
            qemu_plugin_register_vcpu_insn_exec_cb(insn, (number < REGIONS) ? on_start : on_stop,
                                                   CALLBACK_READS_NO_REGISTERS, &regions[number % REGIONS]);
        }
    }
}

static void on_exit_of_qemu(plugin_id_t id, void *user)
{
    FILE *const out = fopen(out_path, "w");
    (void)id;
    (void)user;
    if (out == NULL) {
        fprintf(stderr, "evcount: cannot write %s\n", out_path);
        return;
    }
    for (int i = 0; i < REGIONS; i++) {
        if (regions[i].n_calls > 0u) {
            fprintf(out, "region %d calls %" PRIu64 " instructions %" PRIu64 "\n", i, regions[i].n_calls,
                    regions[i].n_insns);
        }
    }
    fclose(out);
}

__attribute__((visibility("default"))) int qemu_plugin_install(plugin_id_t id, const void *info, int argc, char **argv)
{
    (void)info;
    for (int i = 0; i < argc; i++) {
        if ((strncmp(argv[i], "out=", 4) == 0) && (strlen(argv[i] + 4) < sizeof out_path)) {
            strcpy(out_path, argv[i] + 4);
        }
    }
    if (out_path[0] == '\0') {
        fprintf(stderr, "evcount: needs out=FILE\n");
        return -1;
    }
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translate);
    qemu_plugin_register_atexit_cb(id, on_exit_of_qemu, NULL);
    return 0;
}
