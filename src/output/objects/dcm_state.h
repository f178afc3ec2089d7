/* The C door to DCMTK for volumetric presentation states: write one, read one. */
#ifndef CTS_DICOM_DCM_STATE_H
#define CTS_DICOM_DCM_STATE_H

#include "ctsplat/labels.h"
#include "output/objects/dcm_sc.h"

CTS_C_BEGIN

enum { CTS_STATE_ENTRIES = 4096 };

/* ctsplat's own block of attributes: what the standard's cannot carry to the last bit. */
enum { CTS_STATE_GROUP = 0x0073, CTS_STATE_CREATOR = 0x0010, CTS_STATE_PRESET = 0x1001, CTS_STATE_OPTIONS = 0x1002 };
#define CTS_STATE_BLOCK "CTSPLAT STATE 1"
#define CTS_STATE_CLASS "1.2.840.10008.5.1.4.1.1.11.9"

typedef struct CtsDcmState {
    const CtsSeries *source;
    const CtsDataSet *header; /* of its first slice */
    const char *sop_uid, *series_uid, *study_uid, *frame_uid, *input_uid;
    int series_number;
    const char *date, *time, *version;
    const char *description; /* ASCII */
    CtsScCode view;
    const char *method; /* (0070,120D) */
    double viewpoint_lps[3], look_at_lps[3], up_lps[3], forward_lps[3];
    double field_mm[6]; /* left, right, top, bottom, near, far */
    bool shaded;
    double ambient, diffuse, specular, shininess; /* each 0..1 */
    bool cropped;
    double crop_lps[6];                       /* two opposite corners */
    const CtsLabels *labels;                  /* that the volume is cropped by, or NULL */
    const CtsLabelCrop *label_crop;           /* of each */
    double window_centre_hu, window_width_hu; /* that the tables below span */
    uint16_t tables[4][CTS_STATE_ENTRIES];    /* red, green, blue, opacity */
    const uint8_t *icc_profile;
    size_t n_icc_profile;
    char capture_class_uid[65], capture_uid[65]; /* "": no picture is referenced */
    const char *preset, *options;                /* private, byte by byte */
} CtsDcmState;

CtsStatus cts_dcm_state_write(const CtsDcmState *state, CtsScSink sink, void *context, CtsError *err);

/* The private texts of a state that ctsplat wrote, which the caller frees with free(), and the series it is of (""
 * where it does not tell). */
CtsStatus cts_dcm_state_read(const char *path, char **preset, char **options, char source_uid[65], CtsError *err);

CTS_C_END
#endif
