/* Diagnostics: notes, warnings, and reasons of refusals, each a row of one table with its code and its severity. */
#pragma once

#include "ctsplat/api.h"
#include <stddef.h>

CTS_API_BEGIN

typedef enum CtsSeverity { CTS_NOTE, CTS_WARNING, CTS_REFUSAL } CtsSeverity;
extern const char *const cts_severity_names[3];

/* row(name, code, severity). A code is a word for programs, whose meaning never changes; one with two severities has
 * two rows. */
/* clang-format off */
#define CTS_DIAGNOSTIC_ROWS(row)                                                                                       \
    row(ACQUISITIONS_PARTED, "acquisitions_parted", WARNING)                                                           \
    row(ANSWERS_LEFT_OUT, "answers_left_out", WARNING)                                                                 \
    row(BAD_SLICES, "bad_slices", WARNING)                                                                             \
    row(BLANK_SLICES, "blank_slices", WARNING)                                                                         \
    row(BURNED_IN_ANNOTATION, "burned_in_annotation", WARNING)                                                         \
    row(CLAMPED_HIGH, "clamped_high", WARNING)                                                                         \
    row(CONCATENATION_INCOMPLETE, "concatenation_incomplete", WARNING)                                                 \
    row(CONSTANT_FILL, "constant_fill", WARNING)                                                                       \
    row(CONTOURS_IGNORED, "contours_ignored", NOTE)                                                                    \
    row(CONTOURS_OFF, "contours_off", WARNING)                                                                         \
    row(COPIES_DROPPED, "copies_dropped", WARNING)                                                                     \
    row(DIRECTORY_ESCAPES, "directory_escapes", WARNING)                                                               \
    row(ERROR_BOUND, "error_bound", WARNING)                                                                           \
    row(FILL_CLEARED, "fill_cleared", NOTE)                                                                            \
    row(FILL_MISSING, "fill_cleared", WARNING)                                                                         \
    row(FOLDER_TOO_DEEP, "folder_too_deep", WARNING)                                                                   \
    row(FRACTIONAL_RESCALE, "fractional_rescale", NOTE)                                                                \
    row(FRAMES_OF_REFERENCE, "frames_of_reference", WARNING)                                                           \
    row(GANTRY_TILT, "gantry_tilt", NOTE)                                                                              \
    row(HU_IMPLAUSIBLE, "hu_implausible", WARNING)                                                                     \
    row(IDENTITY_INCOMPLETE, "identity_incomplete", WARNING)                                                           \
    row(LABEL_FRAME_OF_REFERENCE, "label_frame_of_reference", WARNING)                                                 \
    row(LABEL_IN_AIR, "label_in_air", WARNING)                                                                         \
    row(LABEL_LEFT_OUT, "label_left_out", WARNING)                                                                     \
    row(LABEL_MIRRORED, "label_mirrored", WARNING)                                                                     \
    row(LABEL_OUTSIDE, "label_outside", WARNING)                                                                       \
    row(LABEL_SERIES_UNNAMED, "label_series_unnamed", WARNING)                                                         \
    row(LABEL_WITHOUT_SEGMENT, "label_without_segment", WARNING)                                                       \
    row(LABELS_LACKING, "labels_lacking", NOTE)                                                                        \
    row(LABELS_MISSING, "labels_missing", WARNING)                                                                     \
    row(LABELS_UNKNOWN, "labels_lacking", WARNING)                                                                     \
    row(LATE_FIRST_NUMBER, "late_first_number", NOTE)                                                                  \
    row(LOCALIZERS_DROPPED, "localizers_dropped", WARNING)                                                             \
    row(LOG_LOST, "log_lost", WARNING)                                                                                 \
    row(LONG_PIXELS, "long_pixels", WARNING)                                                                           \
    row(LOSSY, "lossy", WARNING)                                                                                       \
    row(MARKS_LEFT_OUT, "marks_left_out", WARNING)                                                                     \
    row(MAX_ERROR, "max_error", NOTE)                                                                                  \
    row(MAX_ERROR_MISSED, "max_error_missed", WARNING)                                                                 \
    row(MISSING_SLICES, "missing_slices", WARNING)                                                                     \
    row(MONOCHROME1, "monochrome1", WARNING)                                                                           \
    row(MOSTLY_WHITE, "mostly_white", WARNING)                                                                         \
    row(NAMES_IN_PART, "names_in_part", WARNING)                                                                       \
    row(NEARLY_BLACK, "nearly_black", WARNING)                                                                         \
    row(NEARLY_WHITE, "nearly_white", WARNING)                                                                         \
    row(NEGATIVE_SLOPE, "negative_slope", WARNING)                                                                     \
    row(NIFTI_AXES, "nifti_axes", NOTE)                                                                                \
    row(NIFTI_FORM_TAKEN, "nifti_form_taken", NOTE)                                                                    \
    row(NIFTI_FORMS, "nifti_forms", WARNING)                                                                           \
    row(NO_CONTRAST, "no_contrast", WARNING)                                                                           \
    row(NO_OBJECT_OUTPUT, "no_object_output", WARNING)                                                                 \
    row(NO_PREAMBLE, "no_preamble", WARNING)                                                                           \
    row(NO_SUV, "no_suv", WARNING)                                                                                     \
    row(NO_TRANSFER_SYNTAX, "no_transfer_syntax", WARNING)                                                             \
    row(NOISY, "noisy", WARNING)                                                                                       \
    row(NOT_FINITE, "not_finite", WARNING)                                                                             \
    row(NOT_HU, "not_hu", WARNING)                                                                                     \
    row(NOTHING_VISIBLE, "nothing_visible", WARNING)                                                                   \
    row(OCCLUSION_UNUSED, "occlusion_unused", WARNING)                                                                 \
    row(ORDER_CONFLICT, "order_conflict", WARNING)                                                                     \
    row(ORIENTATION_JITTER, "orientation_jitter", NOTE)                                                                \
    row(OTHER_SLICES_DROPPED, "other_slices_dropped", WARNING)                                                         \
    row(OTHER_VERSION, "other_version", NOTE)                                                                          \
    row(OUTLIERS, "outliers", WARNING)                                                                                 \
    row(PAGES_DROPPED, "pages_dropped", WARNING)                                                                       \
    row(PASSED, "passed", NOTE)                                                                                        \
    row(PEER_WARNS, "peer_warns", WARNING)                                                                             \
    row(PIXELS_REFUSED, "pixels_refused", REFUSAL)                                                                     \
    row(PRESET_LEFT_OUT, "preset_left_out", WARNING)                                                                   \
    row(RECOGNIZABLE_FEATURES, "recognizable_features", WARNING)                                                       \
    row(REFUSED, "refused", REFUSAL)                                                                                   \
    row(RESCALE_UNSPECIFIED, "rescale_unspecified", WARNING)                                                           \
    row(ROUGH_ORIENTATION, "rough_orientation", WARNING)                                                               \
    row(SAME_CIRCLE, "same_circle", WARNING)                                                                           \
    row(SERIES_NOT_FETCHED, "series_not_fetched", WARNING)                                                             \
    row(SERIES_NOT_TAKEN, "series_not_taken", WARNING)                                                                 \
    row(SEVERAL_SERIES, "several_series", WARNING)                                                                     \
    row(SEVERAL_VOLUMES, "several_volumes", WARNING)                                                                   \
    row(SIDEWAYS_SHIFT, "sideways_shift", WARNING)                                                                     \
    row(SINGLE_SLICES, "single_slices", NOTE)                                                                          \
    row(SLICE_OFF_NEIGHBOURS, "slice_off_neighbours", WARNING)                                                         \
    row(SLICES_CUBIC, "slices_cubic", NOTE)                                                                            \
    row(SLICES_NOT_SHAPED, "slices_cubic", WARNING)                                                                    \
    row(SLICES_LINEAR, "slices_linear", WARNING)                                                                       \
    row(SLICES_MOVED, "slices_moved", NOTE)                                                                            \
    row(SLICES_WITHOUT_CONTOUR, "slices_without_contour", WARNING)                                                     \
    row(SPACING_IMPLAUSIBLE, "spacing_implausible", WARNING)                                                           \
    row(STATE_LEFT_OUT, "state_left_out", WARNING)                                                                     \
    row(STATE_OF_ANOTHER, "state_of_another", WARNING)                                                                 \
    row(TABLE_REMOVAL_UNCERTAIN, "table_removal_uncertain", WARNING)                                                   \
    row(TABLE_REMOVED, "table_removed", NOTE)                                                                          \
    row(TWO_SLICES, "two_slices", WARNING)                                                                             \
    row(UNEQUAL_SPACING, "unequal_spacing", WARNING)                                                                   \
    row(UNREADABLE_FILE, "unreadable_file", WARNING)                                                                   \
    row(UNREADABLE_FOLDER, "unreadable_folder", WARNING)                                                               \
    row(VOID_KEY, "void_key", NOTE)                                                                                    \
    row(VOID_KEY_LOSES, "void_key", WARNING)                                                                           \
    row(VOID_KEY_UNUSED, "void_key_unused", WARNING)                                                                   \
    row(WINDOW_UNUSED, "window_unused", WARNING)
/* clang-format on */

/* CTS_DIAGNOSTIC_NAME of each row. */
typedef enum CtsDiagnosticId {
#define CTS_DIAGNOSTIC_ID(name, code, severity) CTS_DIAGNOSTIC_##name,
    CTS_DIAGNOSTIC_ROWS(CTS_DIAGNOSTIC_ID) CTS_N_DIAGNOSTICS
#undef CTS_DIAGNOSTIC_ID
} CtsDiagnosticId;

typedef struct CtsDiagnostic {
    CtsDiagnosticId id;
    const char *code; /* code and severity are those of its row */
    CtsSeverity severity;
    char text[400];
} CtsDiagnostic;

typedef struct CtsDiagnostics {
    CtsDiagnostic *items;
    size_t n;
} CtsDiagnostics;

/* A text longer than its field is truncated. Without memory the diagnostic is missing. */
void cts_diagnostics_add(CtsDiagnostics *diagnostics, CtsDiagnosticId id, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* The first of this row; NULL for none. */
const CtsDiagnostic *cts_diagnostics_find(const CtsDiagnostics *diagnostics, CtsDiagnosticId id);
void cts_diagnostics_free(CtsDiagnostics *diagnostics);

CTS_API_END
