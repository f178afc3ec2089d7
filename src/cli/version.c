#include "cli/version.h"

#include <expat.h>
#include <jansson.h>
#include <openexr_base.h>
#include <png.h>
#include <stdio.h>

void cli_version(void)
{
    int major, minor, patch;
    const char *extra;
    exr_get_library_version(&major, &minor, &patch, &extra);
    printf("ctsplat %s\n", CTS_VERSION);
    printf("DCMTK %s\n", CTS_DCMTK_VERSION);
    printf("OpenEXR %d.%d.%d\n", major, minor, patch);
    printf("libpng %s\n", png_get_libpng_ver(NULL));
    printf("jansson %s\n", jansson_version_str());
    printf("%s\n", XML_ExpatVersion());
}
