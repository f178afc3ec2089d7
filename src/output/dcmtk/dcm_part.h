/* The door to DCMTK, from both sides. DCMTK, and what of this folder calls it, is a library of its own
 * (base/load_part.h): linking it takes longer than all else that starting the program takes, and a plain series needs
 * none of it. dcm_part.c has the door's functions for the program: each loads the library and calls the function of the
 * same name in there, which tests link directly. */
#ifndef CTS_DICOM_DCM_PART_H
#define CTS_DICOM_DCM_PART_H

#include "input/codec/codec.h"
#include "input/header/dcm_ids.h"
#include "input/header/dcm_read.h"
#include "output/objects/dcm_sc.h"
#include "output/objects/dcm_sc_read.h"
#include "output/objects/dcm_state.h"

typedef struct CtsDcmPart {
    __typeof__(cts_dcm_start) *start;
    __typeof__(cts_dcm_start_decoders) *start_decoders;
    __typeof__(cts_dcm_parse_header) *parse_header;
    __typeof__(cts_dcm_read_frames) *read_frames;
    __typeof__(cts_dcm_directory) *directory;
    __typeof__(cts_dcm_class_name) *class_name;
    __typeof__(cts_dcm_convert) *convert;
    __typeof__(cts_dcm_decode) *decode;
    __typeof__(cts_dcm_ids) *ids;
    __typeof__(cts_dcm_sc_source) *sc_source;
    __typeof__(cts_dcm_sc_header) *sc_header;
    __typeof__(cts_dcm_sc_write) *sc_write;
    __typeof__(cts_dcm_sc_encode) *sc_encode;
    __typeof__(cts_dcm_state_write) *state_write;
    __typeof__(cts_dcm_state_read) *state_read;
} CtsDcmPart;

/* What the library shows of itself: cts_dcm_part(). */
typedef const CtsDcmPart *(*cts_dcm_part_fn)(void);

#endif
