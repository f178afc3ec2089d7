#include "engine/tiled/looks.h"

#include "base/mem.h"

static CtsStatus init_look(TiledLooks *looks, const CtsScene *scene, int look, CtsError *err)
{
    CtsScene own = *scene;
    CtsPreset preset = {.unit_distance_mm = 1};
    const CtsOwnerLook *const l = &looks->owners->looks[look];
    CtsStatus st = CTS_OK;
    if (look != CTS_LOOK_HIDDEN)
        cts_owner_preset(l, scene->preset, &preset);
    if (look != CTS_LOOK_HIDDEN && (l->preset || l->opacity >= 0))
        st = cts_lut_new(&looks->own[look], &preset, scene->volume, NULL, scene->extinction_scale, err);
    if (st)
        return st;
    own.preset = &preset;
    own.lut = looks->own[look] ? looks->own[look] : scene->lut;
    cts_tiled_pieces_init(&looks->pieces[look], &own);
    return CTS_OK;
}

CtsStatus cts_tiled_looks_init(TiledLooks *looks, const CtsScene *scene, CtsError *err)
{
    const CtsOwners *const owners = scene->volume->owners;
    CtsStatus st;
    *looks = (TiledLooks){.owners = owners, .n = owners->n_looks};
    if (!(st = cts_alloc_array(&looks->pieces, (size_t)looks->n, err)))
        st = cts_alloc_zeroed(&looks->own, (size_t)looks->n, err);
    for (int l = 0; !st && l < looks->n; l++)
        st = init_look(looks, scene, l, err);
    if (st)
        cts_tiled_looks_free(looks);
    return st;
}

void cts_tiled_looks_free(TiledLooks *looks)
{
    for (int l = 0; looks->own && l < looks->n; l++)
        cts_lut_free(&looks->own[l]);
    cts_free(&looks->pieces);
    cts_free(&looks->own);
}
