/* Which labels the words of a choice mean. */
#ifndef CTS_LABELS_LABEL_CHOICE_H
#define CTS_LABELS_LABEL_CHOICE_H

#include "ctsplat/labels.h"

/* Sets hit[i] = value for each label i that one item of a list names, and hit[labels->n] for the rest. option: whose
 * list it is, for messages. CTS_ERR_USAGE where it names none, or without a file what several files have. */
CtsStatus cts_label_find(const CtsLabels *labels, const char *option, const char *item, size_t length, uint32_t value,
                         uint32_t *hit, CtsError *err);
/* The same with all items of a list: values rise from 1 on, and what was hit keeps its value. */
CtsStatus cts_label_find_list(const CtsLabels *labels, const char *option, const char *list, uint32_t *hit,
                              CtsError *err);

struct CtsOwnerLook;
/* The look that a text asks for, without a name in front. */
CtsStatus cts_label_look(const char *text, struct CtsOwnerLook *look, CtsError *err);
/* The colour of the n-th label that has none of its own: told apart by all who see, however they see colours. */
void cts_label_colour(size_t n, double rgb[3]);

#endif
