/* Two threads that share lists of prepared calls.
 *
 * Whoever asks offers its list to the second thread (share) and takes one call after the other itself (work), as does
 * the second thread, which waits for lists (pool_serve).  A second thread that wakes up late, or never, costs nothing:
 * the first one does what is left.  Where processors have other things to do, two threads may still take longer than
 * one, so lists are timed both ways now and then (job_run).
 */
#define _POSIX_C_SOURCE 200809L
#include "calls.h"

#if defined(_WIN32)
pool *pool_new(void) { return NULL; }
#else
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <time.h>

enum {
    LINGER = 20000, /* nanoseconds for which the second thread looks out for more before it sleeps: to wake it takes
                     * longer than what is shared next may do */
    LOOKS = 100,    /* between two looks at the clock meanwhile */
    PATIENCE = 1000, /* looks before a thread that waits for the other one gives its processor away */
    TRIED = 32,     /* one run in so many goes the other way, to see whether that is the faster one now */
};

typedef struct {
    pool seen; /* first: what is handed out is the address of this */
    pthread_mutex_t lock;
    pthread_cond_t offered;
} helper;

static int64_t get(const int64_t *from) { return __atomic_load_n(from, __ATOMIC_ACQUIRE); }

static void set(int64_t *to, int64_t value) { __atomic_store_n(to, value, __ATOMIC_RELEASE); }

static int64_t count_up(int64_t *of) { return __atomic_fetch_add(of, 1, __ATOMIC_ACQ_REL); }

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void wait_for(const int64_t *ended, int64_t needed) {
    for (int patience = PATIENCE; get(ended) < needed;)
        if (patience > 0) patience--;
        else sched_yield();
}

static void work(job *j) {
    for (int64_t k; (k = count_up(&j->next)) < j->count;) {
        task *t = j->part + k;
        wait_for(&j->ended, t->after);
        t->entry(t->arguments);
        count_up(&j->ended);
    }
}

static void reset(job *j) {
    set(&j->ended, 0);
    set(&j->next, 0);
}

static void share(job *j) {
    helper *h = (helper *)j->helper;
    pool *p = j->helper;
    reset(j);
    if (!get(&p->alive)) { work(j); return; }
    pthread_mutex_lock(&h->lock);
    if (p->offered) { /* another thread is helped already */
        pthread_mutex_unlock(&h->lock);
        work(j);
        return;
    }
    p->offered = j;
    set(&p->offers, p->offers + 1);
    pthread_mutex_unlock(&h->lock);
    pthread_cond_signal(&h->offered);
    work(j);
    wait_for(&j->ended, j->count);
    pthread_mutex_lock(&h->lock);
    p->offered = NULL;
    while (p->active) { /* it has yet to find out that there is nothing left */
        pthread_mutex_unlock(&h->lock);
        sched_yield();
        pthread_mutex_lock(&h->lock);
    }
    pthread_mutex_unlock(&h->lock);
}

int64_t job_run(job *j) {
    timing *t = j->known;
    if (!get(&j->helper->allowed)) {
        reset(j);
        work(j);
        return 0;
    }
    int tried = j->warm && t->runs % TRIED == 0, helped = (t->helped <= t->alone) ^ tried;
    int64_t begin = now(), *time = helped ? &t->helped : &t->alone;
    if (helped) share(j);
    else { reset(j); work(j); }
    if (j->warm) { /* a first run, whose memory is cold, would tell nothing */
        const int64_t took = now() - begin;
        *time = *time == 0 || tried ? took : *time + ((took - *time) >> 2);
        t->runs++;
    }
    j->warm = 1;
    return 0;
}

/* Until there is another list than the last one seen, or it is time to sleep. */
static void look_out(const pool *p, int64_t seen) {
    int64_t begin = now();
    do
        for (int k = 0; k < LOOKS; k++)
            if (get(&p->offers) != seen) return;
    while (now() - begin <= LINGER);
}

void pool_serve(pool *p) {
    helper *h = (helper *)p;
    int64_t seen = 0, tired = 0;
    pthread_mutex_lock(&h->lock);
    while (get(&p->alive)) {
        if (p->offered && p->offers != seen) {
            job *j = p->offered;
            seen = p->offers;
            p->active = 1;
            pthread_mutex_unlock(&h->lock);
            work(j);
            pthread_mutex_lock(&h->lock);
            p->active = 0;
        } else if (seen == tired) {
            pthread_cond_wait(&h->offered, &h->lock);
        } else {
            pthread_mutex_unlock(&h->lock);
            look_out(p, seen);
            pthread_mutex_lock(&h->lock);
            tired = seen;
        }
    }
    pthread_mutex_unlock(&h->lock);
}

pool *pool_new(void) {
    helper *h = calloc(1, sizeof *h);
    if (!h) return NULL;
    if (pthread_mutex_init(&h->lock, NULL) || pthread_cond_init(&h->offered, NULL)) {
        free(h);
        return NULL;
    }
    h->seen.alive = h->seen.allowed = 1;
    return &h->seen;
}

void pool_stop(pool *p) {
    helper *h = (helper *)p;
    pthread_mutex_lock(&h->lock);
    set(&p->alive, 0);
    pthread_mutex_unlock(&h->lock);
    pthread_cond_signal(&h->offered);
}
#endif
