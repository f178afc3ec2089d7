/* Texts whose lists come from the tables of the library: what a row adds there stands in help and messages here. */
#ifndef CTS_WORDS_WORD_LISTS_H
#define CTS_WORDS_WORD_LISTS_H

/* Longest text with its lists in place. */
enum { CTS_WORD_LISTS_MAX = 600 };

/* text with these replaced, in out; returns out. {views}, {kernels}, {formats}: their names; of the formats' endings
 * {outputs} has all, {objects} those of DICOM objects, {stacks} those of which one file holds a rotation. */
const char *cts_word_lists(const char *text, char out[CTS_WORD_LISTS_MAX]);

#endif
