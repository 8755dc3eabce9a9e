#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline, unused))
#else
#define INLINE static inline
#endif

/* sin x and cos x without branches: polynomials of Cephes (Moshier 1989), error below 2e-16 where
   |x| is below ten million. ROUND + v - ROUND is v rounded to a whole number, in a way that every
   compiler turns into vector instructions; -ffast-math would break it. */
#define ROUND 6755399441055744.0
INLINE void sine_and_cosine(double x, double *sine, double *cosine)
{
    const double quarters = (x * 0.63661977236758134 + ROUND) - ROUND;
    const double r = ((x - quarters * 1.57079625129699707031) - quarters * 7.54978941586159635336e-8)
        - quarters * 5.39030285815811905290e-15;
    const double z = r * r;
    const double p = (((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z
        + 2.75573136213857245213e-6) * z - 1.98412698295895385996e-4) * z
        + 8.33333333332211858878e-3) * z - 1.66666666666666307295e-1) * z;
    const double c = (((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z
        - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z
        - 1.38888888888730564116e-3) * z + 4.16666666666665929218e-2) * z;
    const double near_sine = r + r * p;
    const double near_cosine = 1.0 - 0.5 * z + z * c;
    /* -2, -1, 0, 1 or 2 quarter turns, and their own cosine and sine */
    const double quadrant = quarters - 4.0 * ((0.25 * quarters + ROUND) - ROUND);
    const double even = 1.0 - fabs(quadrant);
    const double odd = quadrant * (2.0 - fabs(quadrant));
    *sine = even * near_sine + odd * near_cosine;
    *cosine = even * near_cosine - odd * near_sine;
}

/* atan x without branches, the same source. */
INLINE double arctangent(double x)
{
    const double a = fabs(x);
    const double large = a > 2.414213562373095 ? 1.0 : 0.0;
    const double middle = (a > 0.66 ? 1.0 : 0.0) - large;
    const double numerator = large > 0.5 ? -1.0 : a - middle;
    const double denominator = large > 0.5 ? a : 1.0 + middle * a;
    const double y = numerator / denominator;
    const double z = y * y;
    const double p = (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z
        - 7.500855792314704667340e1) * z - 1.228866684490136173410e2) * z
        - 6.485021904942025371773e1;
    const double q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z
        + 4.328810604912902668951e2) * z + 4.853903996359136964868e2) * z
        + 1.945506571482613964425e2;
    const double start = large * 1.57079632679489661923 + middle * 0.78539816339744830962;
    return copysign(start + (y + y * z * p / q), x);
}

/* 1, 0 or -1. */
INLINE double sign_of(double x)
{
    return (x > 0.0 ? 1.0 : 0.0) - (x < 0.0 ? 1.0 : 0.0);
}
