/* What ctsplat wrote into a presentation state besides the standard's attributes. */
#include "output/objects/objects.h"

#include "input/header/head.h"
#include <stdlib.h>
#include <string.h>

enum { CLASS = 0x00080016, REFERENCED_SERIES = 0x00081115, SERIES_UID = 0x0020000E };

static char *text_of(CtsElements all, uint16_t element)
{
    const CtsElements value = cts_elements_find(all, (uint32_t)CTS_STATE_GROUP << 16 | element);
    return value.at < value.end ? strndup((const char *)value.at, (size_t)(value.end - value.at)) : NULL;
}

static CtsStatus read_texts(CtsElements all, char **preset, char **options, char source_uid[65], CtsError *err)
{
    char class_uid[65], creator[65];
    cts_elements_text(all, CLASS, class_uid, sizeof class_uid);
    if (strcmp(class_uid, CTS_STATE_CLASS) != 0)
        return cts_fail(err, CTS_ERR_READ, "is no Volume Rendering Volumetric Presentation State");
    cts_elements_text(all, (uint32_t)CTS_STATE_GROUP << 16 | CTS_STATE_CREATOR, creator, sizeof creator);
    if (strcmp(creator, CTS_STATE_BLOCK) == 0) {
        *preset = text_of(all, CTS_STATE_PRESET);
        *options = text_of(all, CTS_STATE_OPTIONS);
        cts_elements_text(cts_elements_item(all, REFERENCED_SERIES), SERIES_UID, source_uid, 65);
    }
    return *preset && *options ? CTS_OK
                               : cts_fail(err, CTS_ERR_READ,
                                          "is not of ctsplat's making: what it says in private attributes is missing");
}

CtsStatus cts_dcm_state_read(const char *path, char **preset, char **options, char source_uid[65], CtsError *err)
{
    CtsScratch scratch = {0};
    CtsHead head;
    *preset = *options = NULL;
    source_uid[0] = 0;
    CtsStatus st = cts_head_open(&head, &(CtsFile){.path = path}, &scratch, err);
    if (!st && head.kind != CTS_FILE_DICOM)
        st = cts_fail(err, CTS_ERR_READ, "is no DICOM file");
    if (!st)
        st = read_texts(cts_head_elements(&head), preset, options, source_uid, err);
    cts_head_close(&head);
    cts_scratch_free(&scratch);
    return st ? cts_context(err, "%s", path) : st;
}
