/* Logarithm, power to the base of 2 and inverse root, as good as single precision has them, by the same operations on
 * every path; behind base/simd.h. */

#ifdef SIMD_DOUBLE
enum { FRACTION_BITS = 52 };
#define THREE_QUARTERS INT64_C(0x3fe8000000000000)
#define ROOT_GUESS INT64_C(0x5fe6eb50c7b537a9)
enum { ROOT_NEWTON = 5 };
#else
enum { FRACTION_BITS = 23 };
#define THREE_QUARTERS 0x3f400000
#define ROOT_GUESS 0x5f3759df
enum { ROOT_NEWTON = 3 };
#endif

/* log2(1 + u), for u of -1/4 to 1/2, and an exponent: relative error below 2e-7 (least squares at Chebyshev's nodes).
 */
INLINE vf log2_of(vf u, vi exponent)
{
    vf p = u * -(real)0.0961640105f + (real)0.204127371f;
    p = p * u - (real)0.250652194f;
    p = p * u + (real)0.290073574f;
    p = p * u - (real)0.36033529f;
    p = p * u + (real)0.480847508f;
    p = p * u - (real)0.72135067f;
    p = p * u + (real)1.44269526f;
    return p * u + to_float(exponent);
}

/* For normal x. */
INLINE vf vf_log2(vf x)
{
    const vi exponent = ((vi)x - THREE_QUARTERS) >> FRACTION_BITS;
    return log2_of((vf)((vi)x - (exponent << FRACTION_BITS)) - (real)1.0f, exponent);
}

/* log2(1 - x) for x of 0 to less than 1, as precise where x is small. */
INLINE vf vf_log2_transmittance(vf x)
{
    const vf rest = (real)1.0f - x;
    const vi exponent = ((vi)rest - THREE_QUARTERS) >> FRACTION_BITS;
    const vf u = (vf)((vi)rest - (exponent << FRACTION_BITS)) - (real)1.0f;
    return log2_of(vf_select(vf_lt(x, vf_of(0.25f)), -x, u), exponent);
}

/* 2^x for x of at most 0, 2^-125 for all below: relative error below 3e-7. *less: 1 - 2^x, below 6e-7. */
INLINE vf exp2_of(vf x, vf *less)
{
    x = vf_max(x, vf_of(-125));
    const vi n = to_int(x - (real)0.5f); /* towards 0, so the nearest */
    const vf f = x - to_float(n);
    vf p = f * (real)0.00133908668f + (real)0.00966637395f;
    p = p * f + (real)0.0555035695f;
    p = p * f + (real)0.240223482f;
    p = p * f + (real)0.693147182f;
    p = p * f;
    const vf power = (vf)((vi)(p + (real)1.0f) + (n << FRACTION_BITS));
    /* The exponent n decides, not x: for the x next to -0.5, x - 0.5 is rounded to -1. */
    *less = vf_select(vi_eq(n, vi_of(0)), -p, (real)1.0f - power);
    return power;
}

INLINE vf vf_exp2(vf x)
{
    vf less;
    return exp2_of(x, &less);
}

/* 1 - 2^-x for x of 0 or more. */
INLINE vf vf_opacity(vf x)
{
    vf less;
    exp2_of(-x, &less);
    return less;
}

/* 1 / sqrt(x), x > 0: an initial guess by halving the exponent, and steps of Newton's, each of which squares the error.
 * The processor's square roots and divisions take four times as long. */
INLINE vf vf_inverse_root_by(vf x, int newton)
{
    vf y = (vf)(ROOT_GUESS - ((vi)x >> 1));
    for (int i = 0; i < newton; i++)
        y = y * ((real)1.5f - (real)0.5f * x * y * y);
    return y;
}

INLINE vf vf_inverse_root(vf x)
{
    return vf_inverse_root_by(x, ROOT_NEWTON);
}
