/* Everything that works on numbers, in one unit, since its inner loops are to be copied into their callers. */
#include "batch_tree.h"
#include "front.h"
#include "load.h"
#include "multifrontal.h"
#include "substitute.h"

/* A scale serves as long as the largest entries of all rows are within this factor of 1.  With 1024 for fronts alone, hops and
 * swings take 0.95 of the time, but a mass is not moved in the least time any more where its units are 1e6. */
#define STALE 4.0
#define STALE_OF_SEGMENTS 1024.0

static void eliminate_part(kkt_state *s, batch_work *w) {
    w->panel_count = w->row_count = w->factor_count = 0;
    w->refused = w->no_memory = w->negative = w->operations = w->delayed = 0;
    w->check = w->wasted = w->work = 0.0;
    w->spread = 1.0;
    w->largest = 0.0;
    w->smallest = INFINITY;
    for (int64_t i = 0; i < s->size; i++) w->most[i] = 0.0;
    for (int64_t i = 0; w != s->parts && i < s->size + s->filled; i++) w->result[i] = 0.0;
    for (int32_t g = w->first; g < w->end; g++) {
        batch_load(s, w, s->groups + g, w->most);
        int serves = !s->watched || w->spread <= STALE_OF_SEGMENTS;
        if (serves && !w->refused && !w->no_memory) batch_eliminate_group(s->distance > 0, w, s->groups + g);
    }
}

void kkt_part(kkt *k, int64_t part, int64_t phase) {
    kkt_state *s = KKT_STATE(k);
    batch_work *w = s->parts + part;
    if (phase == KKT_ELIMINATE) eliminate_part(s, w);
    else if (phase == KKT_FORWARD) batch_forward(s, w);
    else if (phase == KKT_BACKWARD) batch_backward(s, w);
    else batch_return(s, w);
}

/* Load the matrix and eliminate the segments: KKT_OK, or why not; `serves`: whether the scale does. */
static int64_t try_scale(kkt_state *s, int *serves) {
    const kkt *k = s->k;
    double *most = s->most + s->outer, check = 0.0, spread = 1.0;
    int refused = 0, no_memory = 0;
    scale_rest(s, 1);
    if (k->groups) {
        memcpy(s->left, s->matrix, sizeof(double) * (size_t)(s->size + s->entries));
        memset(s->left + s->size + s->entries, 0, sizeof(double) * (size_t)(s->filled - s->entries));
        invoke(k->calls, KKT_ELIMINATE);
        for (int64_t part = 0; part < k->parts; part++) {
            const batch_work *w = s->parts + part;
            check += w->check;
            refused |= w->refused != 0;
            no_memory |= w->no_memory != 0;
            raise_to(&spread, w->spread);
            for (int64_t i = 0; i < s->size; i++) raise_to(most + i, w->most[i]);
            for (int64_t i = 0; part && i < s->size + s->filled; i++) s->left[i] += w->result[i];
        }
    }
    if (check != 0.0) return KKT_NOT_FINITE;
    for (int64_t i = 0; i < s->size; i++) {
        double value = most[i] > 0.0 ? most[i] : 1.0;
        raise_to(&spread, value > 1.0 ? value : 1.0 / value);
    }
    *serves = spread <= (k->groups ? STALE_OF_SEGMENTS : STALE);
    return no_memory ? KKT_NO_MEMORY : refused ? KKT_REFUSED : KKT_OK;
}

int64_t load_and_eliminate(kkt_state *s) {
    int serves = 1;
    s->watched = !s->fresh;
    int64_t ended = try_scale(s, &serves);
    if (serves || s->fresh || ended > KKT_OK) return ended;
    s->watched = 0;
    return equilibrate(s) ? KKT_NOT_FINITE : try_scale(s, &serves);
}
