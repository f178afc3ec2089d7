#include "ctsplat/volume.h"

#include "base/mem.h"
#include "core/volume/volume_new.h"
#include <stdlib.h>
#include <string.h>

CtsStatus cts_volume_new_unset(CtsVolume **volume, int nx, int ny, int nz, CtsError *err)
{
    CtsStatus st = cts_volume_new_empty(volume, nx, ny, nz, err);
    if (!st && (st = cts_alloc_array(&(*volume)->grey, cts_volume_n_voxels(*volume), err)))
        cts_volume_free(volume);
    return st;
}

CtsStatus cts_volume_new_like(CtsVolume **volume, const CtsVolume *like, int n_layers, CtsError *err)
{
    const CtsStatus st = cts_volume_new_unset(volume, like->dims[0], like->dims[1], n_layers, err);
    if (st)
        return st;
    uint16_t *const grey = (*volume)->grey;
    **volume = *like;
    (*volume)->grey = grey;
    return CTS_OK;
}

CtsStatus cts_volume_new_empty(CtsVolume **volume, int nx, int ny, int nz, CtsError *err)
{
    *volume = NULL;
    if (nx < 1 || ny < 1 || nz < 1)
        return cts_fail(err, CTS_ERR_GEOMETRY, "a volume of %d x %d x %d voxels is empty", nx, ny, nz);
    size_t n;
    if (cts_mul_overflows((size_t)nx * (size_t)ny, (size_t)nz, &n))
        return cts_fail(err, CTS_ERR_MEMORY, "a volume of %d x %d x %d voxels is too large", nx, ny, nz);
    CtsVolume *v = calloc(1, sizeof *v);
    if (!v)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    v->dims[0] = nx;
    v->dims[1] = ny;
    v->dims[2] = nz;
    for (int axis = 0; axis < 3; axis++)
        v->step_lps[axis][axis] = 1;
    v->slice_layers = 1;
    v->hu_offset = -1024;
    v->hu_step = 1;
    v->hu_min = v->hu_max = -1024;
    *volume = v;
    return CTS_OK;
}

CtsStatus cts_volume_new(CtsVolume **volume, int nx, int ny, int nz, CtsError *err)
{
    const CtsStatus st = cts_volume_new_unset(volume, nx, ny, nz, err);
    if (!st)
        memset((*volume)->grey, 0, cts_volume_n_voxels(*volume) * sizeof *(*volume)->grey);
    return st;
}

void cts_volume_fit_memory(CtsVolume *volume)
{
    const size_t n = cts_volume_n_voxels(volume);
    (void)cts_resize_array(&volume->grey, n, n, NULL); /* on a failure the block stays as it is */
}

void cts_volume_free(CtsVolume **volume)
{
    if (!*volume)
        return;
    cts_free(&(*volume)->grey);
    free(*volume);
    *volume = NULL;
}

size_t cts_volume_n_voxels(const CtsVolume *volume)
{
    return (size_t)volume->dims[0] * (size_t)volume->dims[1] * (size_t)volume->dims[2];
}
