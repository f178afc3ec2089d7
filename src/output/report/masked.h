/* UIDs in texts for the log: one leads to the patient in the archive, its hash does not. */
#ifndef CTS_REPORT_MASKED_H
#define CTS_REPORT_MASKED_H

/* The first half of the UID's SHA-256, in hexadecimal digits; NULL without memory. Free both with free(). */
char *cts_uid_hash(const char *uid);
/* The text with every UID in it as "uid:HASH", but for those of the standard itself; NULL without memory. */
char *cts_without_uids(const char *text);

#endif
