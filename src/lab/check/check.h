/* The numerical stability suite (`ctsplat check`): scenes with a closed form or an exact property, for every engine to
 * which they apply. Uses only the public interface, and so tests the library as users get it. */
#pragma once

#include "ctsplat/status.h"
#include <signal.h>
#include <stdbool.h>

/* The last picture of a result, so that it can be reproduced. */
typedef struct CtsCheckScene {
    int width, height; /* 0: nothing */
    int x, y;          /* the pixel that expected and found are of; -1: they are of no single pixel */
    double azimuth_deg, elevation_deg, mm_per_pixel;
    char preset[160]; /* its points as HU:opacity */
} CtsCheckScene;

typedef struct CtsCheckResult {
    const char *name;   /* of the case, unique together with engine */
    const char *engine; /* or "-" for a case without an engine */
    double expected, found, error, bound;
    bool pass; /* error <= bound */
    CtsCheckScene scene;
    const char *why; /* why it could not be rendered, during the call of sink alone; or NULL */
} CtsCheckResult;

typedef struct CtsCheckSettings {
    int n_threads;    /* 0: the cores this process may use */
    bool uncorrected; /* levels as they are: engines with levels render their finest one, hardly a pixel re-rendered */
    const char *only; /* run the case of this name, or else the cases whose name holds this; NULL: all */
    const volatile sig_atomic_t *stop;
    /* Called once a result, in the order of the table, on the calling thread. */
    void (*sink)(const CtsCheckResult *result, void *context);
    void *context;
} CtsCheckSettings;

/* A case that cannot be rendered is a failure of the case (found NAN), not of the suite;
 * CTS_ERR_USAGE when no case has such a name; CTS_ERR_INTERRUPTED when a stop is requested. */
CtsStatus cts_check_run(const CtsCheckSettings *settings, int *n_cases, int *n_failed, CtsError *err);
