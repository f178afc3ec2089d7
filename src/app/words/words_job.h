/* Words as a job: what was asked for becomes what is done, for one picture or for a batch. */
#ifndef CTS_WORDS_WORDS_JOB_H
#define CTS_WORDS_WORDS_JOB_H

#include "app/job/render_job.h"
#include "app/words/options.h"

CtsSource cts_options_source(const CtsOptions *options, const CtsPreset *preset);

/* What all jobs of these words share, whatever their preset, which is NULL, and their view. */
CtsJob cts_options_job(const CtsOptions *options);

/* Loads a preset and puts in its place what the words say of window, background, mode, lighting and table. The report
 * learns what they cannot change. */
CtsStatus cts_options_preset(const CtsOptions *options, const char *name_or_file, CtsPreset *preset, CtsReport *report,
                             CtsError *err);

/* The words' one job: loads their preset into *preset; *job points at it and at the options. */
CtsStatus cts_options_one_job(const CtsOptions *options, CtsPreset *preset, CtsJob *job, CtsReport *report,
                              CtsError *err);

/* Warns of words that act on DICOM outputs alone where there is none; but for one that acts on more here, or "". */
void cts_options_tell_objects(const CtsOptions *options, bool any_object, const char *but, CtsReport *report);

/* Sends every DICOM output, once it is written; nothing where nothing says so. */
CtsStatus cts_options_send(const CtsOptions *options, CtsError *err);

#endif
