/* Let T be a mean of many numbers of 0..1, t its estimate from numbers drawn at random, none of which stands for more
 * than a share u of T. Of all numbers of one mean, zeros and ones spread an estimate most (their moment generating
 * function is the largest; without replacement it is smaller: Hoeffding 1963, theorem 4), so Chernoff's bound for
 * counts holds: with c = t / u, m = T / u, an estimate as far off on its side has a chance of at most
 * exp(-(c ln(c / m) - c + m)). T may be anything for which that is not below the chance allowed. Nothing found, c = 0,
 * leaves m up to ln(1 / chance): the rule of three. */
#include "base/limits.h"

#include <math.h>

/* Chance of an error beyond either limit. */
#define BEYOND 0.025
/* Errors below this, a step of eight bits, need not be found for limits to allow for them. */
#define LEAST_LARGEST (1.0 / 255)

/* Factor of the estimated ratio of squares to terms. With 2, and one assumed term, 1 of 100,000 limits of single
 * samples was too low (300 samples of 300 pictures), with 1.5 8, with 1 56. */
#define SPREAD 2.0

static double rarity(double count, double mean)
{
    return (count > 0 ? count * log(count / mean) - count : 0) + mean;
}

/* The mean, between `near` count and `far`, at which count has this rarity. */
static double solve(double count, double rare, double near, double far)
{
    for (int i = 0; i < 200 && near != far; i++) {
        const double middle = 0.5 * (near + far);
        if (middle == near || middle == far)
            break;
        if (rarity(count, middle) < rare)
            near = middle;
        else
            far = middle;
    }
    return far;
}

static double upper_limit(double estimate, double unit)
{
    const double count = estimate / unit, rare = -log(BEYOND);
    return unit * solve(count, rare, count, count + rare + sqrt(rare * (rare + 2 * count)));
}

void cts_error_limits(CtsVerified *v)
{
    v->rmse_low = v->rmse_high = v->rmse;
    v->share_high = v->share_above;
    if (!(v->unit > 0)) /* all was sampled */
        return;
    const double largest = fmax(v->max, LEAST_LARGEST), unit = v->unit * largest * largest, mean = v->rmse * v->rmse;
    v->rmse_high = fmin(sqrt(upper_limit(mean, unit)), largest);
    v->rmse_low = mean > 0 ? sqrt(unit * solve(mean / unit, -log(BEYOND), mean / unit, 0)) : 0;
    v->share_high = fmin(upper_limit(v->share_above, v->unit), 1);
}

/* Upper limit of the expectation of a sum of independent terms of 0..1; it is too low with a probability of exp(-odds)
 * at most. A sum with expectation m comes out at s < m or lower with a probability of exp(s - m - s log(s / m)) at
 * most. */
static double expectation_limit(double sum, double odds)
{
    return solve(sum, odds, sum, sum + 3 * odds + 2 * sqrt(odds * sum));
}

/* Of all terms x of mean m and mean square v, E exp(-tx) is largest for the two values 0 and v / m: the parabola that
 * equals exp(-tx) at 0 and touches it at v / m is nowhere below it. So the limit for terms of 0 to v / m holds for sums
 * with this ratio of expectations, too. SPREAD stands for that ratio's being an estimate. */
double cts_terms_limit(const CtsTerms *t, CtsTermRange range, double n)
{
    const double ratio = t->sum > 0 ? (t->squares + range.assumed * t->largest * t->largest) / t->sum : 0,
                 unit = fmin(fmax(SPREAD * ratio, range.least), range.most);
    return unit > 0 ? unit * expectation_limit(t->sum / unit, log(1000)) / n : 0;
}
