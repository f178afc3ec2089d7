/* The rows of the engine table: one code path, two features. */
#include "splat/paper.h"

enum { COMPOSITE = 1u << CTS_MODE_COMPOSITE, EVERY_KERNEL = (1u << CTS_N_KERNELS) - 1 };

static CtsStatus render_classic(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err)
{
    return cts_paper_render(scene, (CtsPaperFeatures){false, false}, picture, report, err);
}

const CtsEngine cts_engine_classic = {"classic", render_classic, COMPOSITE, EVERY_KERNEL};
