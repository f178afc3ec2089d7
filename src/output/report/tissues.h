/* What `ctsplat presets --propose` tells: the mixture of a volume and the void key of a preset. */
#ifndef CTS_REPORT_TISSUES_H
#define CTS_REPORT_TISSUES_H

#include "ctsplat/mixture.h"
#include <stdio.h>

void cts_mixture_print(FILE *file, const CtsMixture *mixture, const CtsVoidKey *key, const char *preset_name);
CtsStatus cts_mixture_print_json(FILE *file, const CtsMixture *mixture, const CtsVoidKey *key, const char *preset_name,
                                 CtsError *err);

#endif
