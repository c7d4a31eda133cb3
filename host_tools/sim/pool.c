/* SPDX-License-Identifier: MIT
 * SPDX-FileCopyrightText: 2026 the evstab authors */
#define _POSIX_C_SOURCE 200809L
#include "pool.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

typedef struct {
    evsim_pool_t *pool;
    unsigned index;
    pthread_t id;
} worker_t;

struct evsim_pool {
    pthread_mutex_t lock;
    pthread_cond_t start;
    pthread_cond_t done;
    unsigned round; /* Goes up with each run. */
    unsigned n_busy;
    bool stop;

    evsim_task_t task;
    void *context;
    unsigned n_tasks;
    atomic_uint next;

    unsigned n_workers; /* Beside the caller. */
    worker_t worker[EVSIM_THREADS_MAX];
};

static void work(evsim_pool_t *pool, unsigned thread)
{
    for (;;) {
        const unsigned task = atomic_fetch_add(&pool->next, 1u);
        if (task >= pool->n_tasks) { return; }
        pool->task(pool->context, task, thread);
    }
}

static void *worker_main(void *argument)
{
    const worker_t *const self = argument;
    evsim_pool_t *const pool = self->pool;
    unsigned seen = 0u;
    (void)pthread_mutex_lock(&pool->lock);
    for (;;) {
        while ((pool->round == seen) && !pool->stop) { (void)pthread_cond_wait(&pool->start, &pool->lock); }
        if (pool->stop) { break; }
        seen = pool->round;
        (void)pthread_mutex_unlock(&pool->lock);
        work(pool, self->index);
        (void)pthread_mutex_lock(&pool->lock);
        if (--pool->n_busy == 0u) { (void)pthread_cond_signal(&pool->done); }
    }
    (void)pthread_mutex_unlock(&pool->lock);
    return NULL;
}

evsim_pool_t *evsim_pool_start(unsigned n_threads)
{
    evsim_pool_t *const pool = calloc(1u, sizeof *pool);
    if (pool == NULL) { return NULL; }
    (void)pthread_mutex_init(&pool->lock, NULL);
    (void)pthread_cond_init(&pool->start, NULL);
    (void)pthread_cond_init(&pool->done, NULL);
    atomic_init(&pool->next, 0u);
    while ((pool->n_workers + 1u < n_threads) && (pool->n_workers + 1u < EVSIM_THREADS_MAX)) {
        worker_t *const w = &pool->worker[pool->n_workers];
        w->pool = pool;
        w->index = pool->n_workers + 1u;
        if (pthread_create(&w->id, NULL, worker_main, w) != 0) { break; }
        pool->n_workers++;
    }
    return pool;
}

unsigned evsim_pool_threads(const evsim_pool_t *pool) { return pool->n_workers + 1u; }

void evsim_pool_run(evsim_pool_t *pool, evsim_task_t task, void *context, unsigned n_tasks)
{
    (void)pthread_mutex_lock(&pool->lock);
    pool->task = task;
    pool->context = context;
    pool->n_tasks = n_tasks;
    atomic_store(&pool->next, 0u);
    pool->n_busy = pool->n_workers;
    pool->round++;
    (void)pthread_cond_broadcast(&pool->start);
    (void)pthread_mutex_unlock(&pool->lock);
    work(pool, 0u);
    (void)pthread_mutex_lock(&pool->lock);
    while (pool->n_busy > 0u) { (void)pthread_cond_wait(&pool->done, &pool->lock); }
    (void)pthread_mutex_unlock(&pool->lock);
}

void evsim_pool_stop(evsim_pool_t *pool)
{
    if (pool == NULL) { return; }
    (void)pthread_mutex_lock(&pool->lock);
    pool->stop = true;
    (void)pthread_cond_broadcast(&pool->start);
    (void)pthread_mutex_unlock(&pool->lock);
    for (unsigned i = 0u; i < pool->n_workers; i++) { (void)pthread_join(pool->worker[i].id, NULL); }
    (void)pthread_mutex_destroy(&pool->lock);
    (void)pthread_cond_destroy(&pool->start);
    (void)pthread_cond_destroy(&pool->done);
    free(pool);
}
