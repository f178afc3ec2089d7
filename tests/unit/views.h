/* Views for comparisons: along axes and diagonals, almost along an axis, and others. */
#pragma once

#include "scenes.h"

static const double views[][2] = {
    {0, 0},      {90, 0},      {180, 0}, {-90, 0}, {0, 90}, {0, -90}, {30, 20}, {45, 0}, {45, 35.26438968275466},
    {-120, -50}, {1e-9, 1e-9}, {7, 3}};
enum { N_VIEWS = sizeof views / sizeof views[0] };
