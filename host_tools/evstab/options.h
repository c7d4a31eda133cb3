/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  options.h
 * @brief Command-line options from one table, which is the help text too: help cannot list what does not exist.
 *
 * Long options by their full name, "--name value" or "--name=value", short ones for a few; "--" ends them. A word that
 * is wrong gives one line on stderr and exit status 2.
 */
#ifndef EVT_OPTIONS_H
#define EVT_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    const char *name;       /**< Without the dashes. */
    char short_name;        /**< '\0' = none. */
    const char *value_name; /**< "FILE", or NULL: the option is a flag. */
    const char *help;       /**< One or more lines, parted by '\n'. */
    const char **value;     /**< Where the text goes... */
    bool *flag;             /**< ...or that the flag was given. */
} evt_option_t;

typedef struct {
    const char *command;  /**< "replay" */
    const char *synopsis; /**< "INPUT -o DIR [options]" */
    const char *about;    /**< What it does, wrapped by hand. */
    const char *examples; /**< Lines that a user can copy; may be NULL. */
    const evt_option_t *options;
    size_t n_options;
    size_t n_words_min; /**< Words that are no options. */
    size_t n_words_max;
} evt_usage_t;

/**
 * @param[out] words  n_words_max texts; those not given are NULL.
 * @param[out] status  Exit status when the command shall end now.
 * @return false when it shall: help was printed, or the usage is wrong.
 */
bool evt_options_parse(const evt_usage_t *usage, int argc, char **argv, const char **words, int *status);

/** Print "evstab COMMAND: ..." and where to find help. @return EVT_EXIT_USAGE, for `return`. */
int evt_usage_error(const evt_usage_t *usage, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 2, 3)))
#endif
    ;

/** Values. Each is false for a text that is not wholly one such value in the range. */
bool evt_parse_int(const char *text, int64_t low, int64_t high, int64_t *value);
bool evt_parse_seconds(const char *text, int64_t *t_us);                  /**< Exact decimal to microseconds. */
bool evt_parse_size(const char *text, uint16_t *width, uint16_t *height); /**< "240x180", up to 2048. */
bool evt_parse_on_off(const char *text, bool *on);

#endif
