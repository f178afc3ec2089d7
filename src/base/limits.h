/* Confidence limits of a picture's error, for any distribution of errors. */
#pragma once

#include "ctsplat/report.h"

/* From rmse, max, share_above and unit: rmse_low and rmse_high (together 95 %), which hold where no pixel's error is
 * larger than the largest found, or 1/255, as the error estimate has limits of its terms; and share_high (97.5 %),
 * which assumes nothing of pixels that were not sampled, and so bounds the pixels with larger errors. */
void cts_error_limits(CtsVerified *verified);

/* Independent random terms, at least 0, whose expectations sum to the sum of n numbers. */
typedef struct CtsTerms {
    double sum, squares; /* of the terms, and of their squares */
    double largest;
} CtsTerms;

static inline void cts_terms_add(CtsTerms *terms, const CtsTerms *more)
{
    terms->sum += more->sum;
    terms->squares += more->squares;
    terms->largest = terms->largest > more->largest ? terms->largest : more->largest;
}

static inline void cts_terms_add_one(CtsTerms *terms, double term)
{
    cts_terms_add(terms, &(CtsTerms){term, term * term, term});
}

typedef struct CtsTermRange {
    double assumed; /* number of terms that are assumed besides, as large as the largest */
    double least;   /* size of terms where none is larger than 0 */
    double most;    /* size that no term exceeds */
} CtsTermRange;

/* Upper limit of the mean of the n numbers, which holds with a probability of 99.9 %. */
double cts_terms_limit(const CtsTerms *terms, CtsTermRange range, double n);
