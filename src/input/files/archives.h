/* Archives that stay in memory, and their members by path. */
#ifndef CTS_DICOM_ARCHIVES_H
#define CTS_DICOM_ARCHIVES_H

#include "ctsplat/series.h"
#include "input/files/archive.h"
#include "input/files/scan.h"

/* Takes archive over, in any case. *archives is made where it is NULL. */
CtsStatus cts_archives_add(CtsArchives **archives, const char *path, CtsArchive *archive, CtsError *err);

/* The file of this path, which stays the caller's; false when no archive has it. archives may be NULL. */
bool cts_archives_find(const CtsArchives *archives, const char *path, CtsFile *file);

#endif
