/* DCMTK's log, counted instead of printed. C++ only, for the door's own files. */
#ifndef CTS_DICOM_DCM_LOG_H
#define CTS_DICOM_DCM_LOG_H

/* Warnings and errors that DCMTK logged in this thread since the last reset, and the first one's text. */
struct CtsDcmLog {
    unsigned n;
    char first[120];
};

CtsDcmLog &cts_dcm_log();
void cts_dcm_log_reset();

#endif
