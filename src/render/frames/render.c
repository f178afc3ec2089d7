/* The public rendering functions: settings, a plan for the requested error, frames in bands of rows. */
#include "base/enum_table.h"
#include "render/engines/engines.h"
#include "render/frames/frames.h"

CTS_ENUM_TABLE(char *const, cts_fit_names, CTS_N_FITS, [CTS_FIT_VOLUME] = "volume", [CTS_FIT_VISIBLE] = "visible");

CTS_ENUM_TABLE(CtsNamedView, cts_views, CTS_N_VIEWS, {"anterior", 0, 0}, {"posterior", 180, 0}, {"left", 90, 0},
               {"right", -90, 0}, {"head", 0, 90}, {"feet", 0, -90});

static CtsStatus begin_frame(CtsRenderer *r, const double view_deg[2], int least_lossy, CtsFrame *frame,
                             CtsReport *report, CtsError *err)
{
    CtsStatus st;
    *frame = (CtsFrame){.renderer = r};
    if (!r->is_planned && (st = cts_quality_search(r, view_deg, report, err)))
        return st;
    r->is_planned = true;
    return cts_frame_begin(frame, r, view_deg, least_lossy, report, err);
}

/* Only the engine's plan, for --explain. */
static CtsStatus explain_frame(const CtsFrame *frame, CtsReport *report, CtsError *err)
{
    return cts_engine(frame->engine_id)->render(&frame->store.scene, NULL, NULL, report, err);
}

CtsStatus cts_render_frame(CtsRenderer *r, double azimuth_deg, double elevation_deg, CtsPicture **picture,
                           CtsReport *report, CtsError *err)
{
    CtsFrame frame;
    *picture = NULL;
    CtsStatus st = begin_frame(r, (double[]){azimuth_deg, elevation_deg}, 0, &frame, report, err);
    if (!st)
        st = r->settings.explain ? explain_frame(&frame, report, err)
                                 : cts_frame_rows(&frame, 0, r->settings.height, picture, report, err);
    if ((st = cts_frame_end(&frame, st, report, err)))
        cts_picture_free(picture);
    return st;
}

static int choose_rows(const CtsRenderSettings *s, int strip_rows, int max_rows)
{
    enum { BAND_BYTES = 128 << 20 };
    const size_t row_bytes = (size_t)s->width * (s->want_depth ? 5 : 4) * sizeof(float);
    size_t n = BAND_BYTES / row_bytes;
    if (max_rows > 0 && (size_t)max_rows < n)
        n = (size_t)max_rows;
    n = n / (size_t)strip_rows * (size_t)strip_rows;
    n = n > 0 ? n : (size_t)strip_rows;
    return n < (size_t)s->height ? (int)n : s->height;
}

static CtsStatus render_band(CtsFrame *frame, int first_row, int n_rows, const CtsBandSink *sink, CtsReport *report,
                             CtsError *err)
{
    CtsPicture *band = NULL;
    const CtsVoxelCounts before = report ? report->voxels : (CtsVoxelCounts){0};
    CtsStatus st = cts_frame_rows(frame, first_row, n_rows, &band, report, err);
    /* Voxel counts of a picture are those of the band that needed most. */
    if (report && first_row > 0 && before.splatted > report->voxels.splatted)
        report->voxels = before;
    if (!st)
        st = sink->take(sink->context, band, err);
    cts_frame_return(frame, &band);
    return st;
}

CtsStatus cts_render_bands(CtsRenderer *r, double azimuth_deg, double elevation_deg, const CtsBandSink *sink,
                           CtsReport *report, CtsError *err)
{
    enum { KEY_PIXELS = 256 };
    const CtsRenderSettings *const s = &r->settings;
    CtsFrame frame;
    CtsStatus st = begin_frame(r, (double[]){azimuth_deg, elevation_deg}, KEY_PIXELS, &frame, report, err);
    if (!st && s->explain)
        st = explain_frame(&frame, report, err);
    const int height = s->explain ? 0 : s->height;
    const int n_rows = choose_rows(s, cts_frame_strip_rows(&frame), sink->max_rows);
    if (n_rows < height)
        cts_report_skip(report, "whole picture",
                        "rendered and written in bands of %d rows, to limit memory or to report progress%s", n_rows,
                        r->engine->is_layered ? "; sheets are computed again for each" : "");
    for (int row = 0; row < height && !st; row += n_rows)
        st = render_band(&frame, row, height - row < n_rows ? height - row : n_rows, sink, report, err);
    return cts_frame_end(&frame, st, report, err);
}

CtsStatus cts_render(const CtsModel *model, const CtsPreset *preset, const CtsRenderSettings *settings,
                     CtsPicture **picture, CtsReport *report, CtsError *err)
{
    CtsRenderer *renderer;
    *picture = NULL;
    CtsStatus st = cts_render_begin(&renderer, model, preset, settings, err);
    if (!st)
        st = cts_render_frame(renderer, settings->azimuth_deg, settings->elevation_deg, picture, report, err);
    cts_render_end(&renderer);
    return st;
}
