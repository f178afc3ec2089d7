#include "engine/tiled/trace.h"

#include "base/mem.h"
#include <stdio.h>

/* One ray under way. */
typedef struct Trace {
    const TiledJob *job;
    const CtsVolume *volume;
    const char *precision;
    CtsReport *report;
} Trace;

static double traced_hu_of(const Trace *t, double level)
{
    return t->volume->hu_offset + level * t->volume->hu_step;
}

/* A number, or null where the first and last segments of the transfer function have no end. */
static const char *hu_text(const Trace *t, float level, float rest, char text[32])
{
    if (level <= -1e30f || level >= 1e30f)
        return "null";
    snprintf(text, 32, "%.9g", traced_hu_of(t, (double)level + (double)rest));
    return text;
}

static void write_segment(void *context, const TiledSegment *s)
{
    const Trace *const t = context;
    const TiledTransfer *const transfer =
        t->job->appearances ? &t->job->appearances->transfer[s->appearance] : &t->job->transfer;
    const int q = s->transfer_segment, *const before = t->volume->air_before;
    char low[32], high[32];
    cts_report_trace(
        t->report,
        "{\"trace\":\"segment\",\"precision\":\"%s\",\"outcome\":\"%s\",\"t_mm\":%.9g,\"length_mm\":%.9g,"
        "\"cell\":[%d,%d,%d],\"hu\":[%.9g,%.9g,%.9g,%.9g],\"appearance\":%d,\"transfer_segment\":%d,"
        "\"transfer_hu\":[%s,%s],\"depth\":%.9g,\"rgb\":[%.9g,%.9g,%.9g],\"transmittance\":[%.9g,%.9g],"
        "\"error\":{\"depth\":%.3g,\"colour\":%.3g,\"control_points\":%.3g}}",
        t->precision, s->integrated ? "integrated" : "split", s->t_mm, s->length_mm, s->cell[0] + before[0],
        s->cell[1] + before[1], s->cell[2] + before[2], traced_hu_of(t, s->level[0]), traced_hu_of(t, s->level[1]),
        traced_hu_of(t, s->level[2]), traced_hu_of(t, s->level[3]), s->appearance, q,
        hu_text(t, transfer->end[0][q], transfer->remainder[0][q], low),
        hu_text(t, transfer->end[1][q], transfer->remainder[1][q], high), s->depth, s->rgb[0], s->rgb[1], s->rgb[2],
        s->transmittance[0], s->transmittance[1], s->depth_error, s->colour_error, s->control_point_error);
}

CtsStatus cts_tiled_trace(const TiledJob *job, const CtsScene *scene, cts_tiled_march_fn march, const char *precision,
                          int x, int y, CtsReport *report, CtsError *err)
{
    Trace trace = {job, scene->volume, precision, report};
    const TiledTrace segments = {write_segment, &trace};
    TiledJob traced = *job;
    TiledScratch *scratch = NULL;
    const CtsStatus st = cts_alloc_zeroed(&scratch, 1, err);
    if (st)
        return st;
    TiledRays *const rays = &scratch->rays;
    traced.trace = &segments;
    cts_tiled_add_ray(&traced, rays, x, y, -INFINITY);
    cts_report_trace(report,
                     "{\"trace\":\"ray\",\"precision\":\"%s\",\"pixel\":[%d,%d],\"hits_volume\":%s,\"start_mm\":%.9g,"
                     "\"length_mm\":%.9g,\"tolerance\":%.3g,\"min_transmittance\":%.3g}",
                     precision, x, y, rays->n ? "true" : "false", rays->n ? job->camera_mm + rays->start_mm[0] : 0,
                     rays->n ? rays->length_mm[0] : 0, (double)job->tolerance, (double)job->min_transmittance);
    march(&traced, rays, &scratch->counts);
    const float *const p = rays->rgba[0];
    float shading_error = 0;
    for (int queue = 0; job->shade && queue < TILED_SHADING_QUEUES; queue++)
        shading_error += rays->light[queue][0][3];
    if (rays->n)
        cts_report_trace(report,
                         "{\"trace\":\"pixel\",\"precision\":\"%s\",\"rgba\":[%.9g,%.9g,%.9g,%.9g],"
                         "\"left_out\":%.3g,\"error\":%.3g,\"shading_error\":%.3g}",
                         precision, (double)p[0], (double)p[1], (double)p[2], (double)p[3], (double)rays->left[0],
                         (double)rays->bound[0], (double)shading_error);
    cts_free(&scratch);
    return CTS_OK;
}
