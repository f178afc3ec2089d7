/* The rows of the engine table: one code path, two features. */
#include "engine/splat/paper.h"

enum { COMPOSITE = 1u << CTS_MODE_COMPOSITE, EVERY_KERNEL = (1u << CTS_N_KERNELS) - 1 };

#define ENGINE(id, reuse_layers, without_void)                                                                         \
    static CtsStatus render_##id(const CtsScene *scene, CtsPicture *picture, CtsReport *report, CtsError *err)         \
    {                                                                                                                  \
        return cts_paper_render(scene, (CtsPaperFeatures){reuse_layers, without_void}, picture, report, err);          \
    }                                                                                                                  \
    const CtsEngine cts_engine_##id = {                                                                                \
        .name = #id,                                                                                                   \
        .render = render_##id,                                                                                         \
        .modes = COMPOSITE,                                                                                            \
        .kernels = EVERY_KERNEL,                                                                                       \
        .repeats_layers = true,                                                                                        \
        .skips_void = without_void,                                                                                    \
        .takes_key = without_void,                                                                                     \
    };

ENGINE(classic, false, false)
ENGINE(layers, true, false)
ENGINE(void, false, true)
ENGINE(combined, true, true)
