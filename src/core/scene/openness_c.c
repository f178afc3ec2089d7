/* The kernel of openness in plain C. */
#include "core/scene/openness_tmpl.h"

void cts_openness_look_c(const OpennessWay way[OPENNESS_DIRECTIONS], int i, uint8_t *openness)
{
    look_from(way, i, openness);
}
