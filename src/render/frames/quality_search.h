/* --max-error by trial: the cheapest plan whose error on some rays of the same view stays below it. */
#pragma once

#include "render/frames/frames.h"

/* The plan for the frames' settings. An engine with error control gets the requested error; for others the fewest
 * samples per layer are determined by trials on a small picture of this view (azimuth and elevation). The report
 * contains the error found, and a warning where no plan meets the request. */
CtsStatus cts_quality_search(CtsFrames *frames, const double view_deg[2], CtsPlan *plan, CtsReport *report,
                             CtsError *err);
