/* The rows of the engine table: one code path, two features. */
#include "splat/paper.h"

enum { COMPOSITE = 1u << CTS_MODE_COMPOSITE, EVERY_KERNEL = (1u << CTS_N_KERNELS) - 1 };

#define ENGINE(name, reuse_layers, skip_void)                                                                          \
    static CtsStatus render_##name(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err)       \
    {                                                                                                                  \
        return cts_paper_render(scene, (CtsPaperFeatures){reuse_layers, skip_void}, picture, report, err);             \
    }                                                                                                                  \
    const CtsEngine cts_engine_##name = {#name, render_##name, COMPOSITE, EVERY_KERNEL, skip_void, NULL};

ENGINE(classic, false, false)
ENGINE(layers, true, false)
ENGINE(void, false, true)
ENGINE(combined, true, true)
