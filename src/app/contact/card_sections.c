#include "app/contact/contact_sheet.h"

#include "app/job/patient_sections.h"
#include "output/image/whole_picture.h"

CtsStatus cts_card_sections(const CtsScanned *scanned, const CtsLabels *labels, CtsPicture **picture, CtsError *err)
{
    enum { N = 3 };
    static const CtsSection planes[N] = {{CTS_PLANE_AXIAL, 0}, {CTS_PLANE_CORONAL, 0}, {CTS_PLANE_SAGITTAL, 0}};
    const CtsRenderSettings square = {.width = CTS_SECTION_SIDE, .height = CTS_SECTION_SIDE};
    CtsPicture *squares[N] = {NULL};
    CtsStatus st = cts_picture_new(picture, N * CTS_SECTION_SIDE, CTS_SECTION_SIDE, 4, err);
    if (!st)
        st = cts_sections(scanned, labels, &square, planes, N, squares, err);
    for (int i = 0; i < N; i++) {
        if (!st)
            cts_picture_place(*picture, squares[i], i * CTS_SECTION_SIDE, 0);
        cts_picture_free(&squares[i]);
    }
    if (st)
        cts_picture_free(picture);
    return st;
}
