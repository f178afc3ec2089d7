/* Texts of DICOM headers in any character set. All calls are thread-safe. */
#pragma once

/* Text in a DICOM character set (0008,0005; "": ASCII) as UTF-8, at most 64 characters; controls and inconvertible
 * characters become '?'. NULL without memory. */
char *cts_dcm_utf8(const char *text, const char *charset);
/* The same, of any length and with all that is in it; NULL when it cannot, too. Free with free(). */
char *cts_dcm_convert(const char *text, const char *charset);
