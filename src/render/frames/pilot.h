/* --max-error by trial: the cheapest plan whose error on some rays of the same view stays below it. */
#ifndef CTS_RENDER_PILOT_H
#define CTS_RENDER_PILOT_H

#include "render/frames/frames.h"

/* The plan for frames' settings. An engine that bounds its error gets what is asked; for others it is tried out on this
 * view (azimuth and elevation): the fewest samples a layer that keep the error on a small picture. The report tells the
 * error found, and warns where no plan keeps it small enough. */
CtsStatus cts_pilot_plan(CtsFrames *frames, const double view_deg[2], CtsPlan *plan, CtsReport *report, CtsError *err);

#endif
