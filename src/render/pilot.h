/* --max-error by trial: the cheapest plan whose error on some rays of the same view stays below it. */
#ifndef CTS_RENDER_PILOT_H
#define CTS_RENDER_PILOT_H

#include "render/frames.h"

/* The plan for frames' settings, tried out on this view (azimuth and elevation): for an engine that plans by error the
 * largest, and so the cheapest, max_error that keeps what was asked on some bands of the picture itself; for others the
 * fewest samples a layer that do on a small picture. What the settings ask where nothing is to be tried. The report
 * tells the error found, and warns where no plan keeps it small enough. */
CtsStatus cts_pilot_plan(CtsFrames *frames, const double view_deg[2], CtsPlan *plan, CtsReport *report, CtsError *err);

#endif
