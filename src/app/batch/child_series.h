/* What a process tells of a series that it makes: cts_child_begin(), then the volume is read, cts_child_loaded(), then
 * for each picture its files and cts_child_picture_done(), and cts_child_end() with what came of it. */
#ifndef CTS_BATCH_CHILD_SERIES_H
#define CTS_BATCH_CHILD_SERIES_H

#include "app/batch/child.h"
#include "app/contact/thumbnail.h"
#include "output/report/info.h"

/* What has to be made of a series: the child's pictures. None: it all stands, or it cannot be rendered; then
 * cts_child_end() comes next. */
CtsStatus cts_child_begin(CtsBatchChild *child, const CtsSeries *series, CtsError *err);
/* The volume is in memory: waits until it is this process's turn to render. */
CtsStatus cts_child_loaded(CtsBatchChild *child, const CtsPixelFacts *facts, CtsError *err);
/* A file of a picture that is whole, or one of its thumbnails. frame: of a rotation, else -1. */
CtsStatus cts_child_output(CtsBatchChild *child, const CtsBatchPicture *picture, const char *path, int frame,
                           CtsError *err);
CtsStatus cts_child_thumbnail(CtsBatchChild *child, const CtsBatchPicture *picture, const CtsThumbnailFile *file,
                              CtsError *err);
/* The series' slices with its labels' outlines. */
CtsStatus cts_child_label_slices(CtsBatchChild *child, const char *path, uint64_t bytes, CtsError *err);
/* All files of a picture are whole: they are the batch's from here on. The report knows what its verification found,
 * and its findings from first_finding on are the picture's. */
CtsStatus cts_child_picture_done(CtsBatchChild *child, const CtsBatchPicture *picture, const CtsReport *report,
                                 size_t first_finding, CtsError *err);
/* A series came to its end: status and why are what its rendering ended with. */
CtsStatus cts_child_end(CtsBatchChild *child, const CtsReport *report, CtsStatus status, const CtsError *why);

#endif
