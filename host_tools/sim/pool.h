/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
/**
 * @file  pool.h
 * @brief A few threads that share numbered tasks. The caller's thread works too; a pool of one starts none.
 */
#ifndef EVSIM_POOL_H
#define EVSIM_POOL_H

#include <stdbool.h>

#define EVSIM_THREADS_MAX 256u

typedef struct evsim_pool evsim_pool_t;

/** @param thread  Below evsim_pool_threads(): for scratch memory. */
typedef void (*evsim_task_t)(void *context, unsigned task, unsigned thread);

/** @return NULL: out of memory. If the system gives fewer threads than asked for, the pool is smaller. */
evsim_pool_t *evsim_pool_start(unsigned n_threads);
unsigned evsim_pool_threads(const evsim_pool_t *pool);

/** Run task(context, 0 .. n_tasks - 1, ...) in any order; returns when all are done. */
void evsim_pool_run(evsim_pool_t *pool, evsim_task_t task, void *context, unsigned n_tasks);

void evsim_pool_stop(evsim_pool_t *pool);

#endif
