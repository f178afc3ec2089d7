/* The kernel of openness in plain C. */
#include "core/scene/openness_tmpl.h"

void cts_openness_beams_c(const OpennessBeams beams[OPENNESS_DIRECTIONS], int i, uint8_t *openness)
{
    follow_beams_from(beams, i, openness);
}
