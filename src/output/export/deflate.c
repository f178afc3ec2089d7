#include "output/export/deflate.h"

#include "base/mem.h"
#include <isa-l.h>
#include <stdlib.h>
#include <string.h>

struct CtsDeflater {
    struct isal_zstream z;
    uint8_t work[ISAL_DEF_LVL1_DEFAULT];
    size_t most, n_packed;
    uint8_t bytes[]; /* most of a piece, then n_packed of it packed */
};

CtsStatus cts_deflater_new(CtsDeflater **deflater, size_t most, CtsError *err)
{
    /* Where nothing can be packed, deflate stores: 5 bytes for each block. */
    const size_t n_packed = most + most / 512 + 1024;
    const CtsStatus st = cts_alloc_zeroed_bytes((void **)deflater, 1, sizeof **deflater + most + n_packed, err);
    if (st)
        return st;
    (*deflater)->most = most;
    (*deflater)->n_packed = n_packed;
    isal_deflate_init(&(*deflater)->z);
    return CTS_OK;
}

uint8_t *cts_deflater_room(CtsDeflater *deflater)
{
    return deflater->bytes;
}

CtsStatus cts_deflate(CtsDeflater *d, size_t n, bool last, uint8_t **bytes, size_t *n_bytes)
{
    struct isal_zstream *const z = &d->z;
    isal_deflate_reset(z);
    z->level = 1;
    z->level_buf = d->work;
    z->level_buf_size = sizeof d->work;
    z->flush = last ? NO_FLUSH : SYNC_FLUSH;
    z->end_of_stream = last;
    z->next_in = d->bytes;
    z->avail_in = (uint32_t)n;
    z->next_out = d->bytes + d->most;
    z->avail_out = (uint32_t)d->n_packed;
    if (isal_deflate(z) != COMP_OK || z->avail_in != 0 || z->avail_out == 0)
        return CTS_ERR_INTERNAL;
    *n_bytes = d->n_packed - z->avail_out;
    if (!(*bytes = malloc(*n_bytes)))
        return CTS_ERR_MEMORY;
    memcpy(*bytes, d->bytes + d->most, *n_bytes);
    return CTS_OK;
}
