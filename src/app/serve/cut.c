/* Volumes made of what was scanned, and their renderers. */
#include "app/serve/shelf.h"

#include "base/clock.h"
#include <stdlib.h>
#include <string.h>

/* Idle renderers of one volume: as many presets as a page has at hand. */
enum { IDLE_LENSES = 6 };

static void free_lens(CtsLens *lens)
{
    cts_render_end(&lens->prepared.renderer);
    free(lens->preset);
    free(lens);
}

void cts_cut_free(CtsCut *cut)
{
    for (CtsLens *l = cut->lenses, *next; l; l = next) {
        next = l->next;
        free_lens(l);
    }
    cts_volume_free(&cut->volume);
    free(cut->choice);
    free(cut);
}

/* Those that were not used longest go, but those in use. */
static void drop_idle(CtsCut *cut)
{
    int n = 0;
    CtsLens **oldest = NULL;
    for (CtsLens **l = &cut->lenses; *l; l = &(*l)->next)
        if (!(*l)->in_use) {
            n++;
            if (!oldest || (*l)->used_ms < (*oldest)->used_ms)
                oldest = l;
        }
    if (n <= IDLE_LENSES)
        return;
    CtsLens *const gone = *oldest;
    *oldest = gone->next;
    free_lens(gone);
}

CtsLens *cts_cut_lens(CtsCut *cut, const CtsJob *job, const char *preset_json, bool *is_new)
{
    CtsLens *l = cut->lenses;
    while (l && (l->in_use || strcmp(l->preset, preset_json) || !cts_job_again(job, &l->prepared)))
        l = l->next;
    *is_new = !l;
    if (!l && (l = calloc(1, sizeof *l))) {
        if (!(l->preset = strdup(preset_json))) {
            free(l);
            return NULL;
        }
        l->next = cut->lenses;
        cut->lenses = l;
    }
    if (l)
        l->in_use = true;
    return l;
}

void cts_cut_give_back(CtsCut *cut, CtsLens *lens, bool failed)
{
    lens->in_use = false;
    lens->used_ms = cut->used_ms = cts_wall_ms();
    CtsLens **link = &cut->lenses;
    while (*link != lens)
        link = &(*link)->next;
    if (failed) {
        *link = lens->next;
        free_lens(lens);
    }
    drop_idle(cut);
}
