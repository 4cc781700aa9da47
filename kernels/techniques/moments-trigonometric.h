// Trigonometric moments: two complex ones say how absorbance is spread over depth (moments.cl).
//
// A depth z from -1 to 1 is a point e^(i phi) of the unit circle, with phi = (z + 1) (pi - WRAPPING / 2), so from 0 to
// 2 pi - WRAPPING (Muenstermann et al. 2018, section 3.3 and algorithm 2). b[k] is the sum of Ai e^(i k phi_i) over that
// of Ai. The canonical representation has one mass at a point of the circle and two others, at roots of
//   K(z, w) = sum over j of conj(p[j](z)) p[j](w) / D[j]
// where p[0] to p[2] are orthogonal under the moments (Szegoe 1939, chapter 11). With w = z e^(i delta), e^(-i delta) K is
// real. So u = cot(delta / 2) is a root of a quadratic with real coefficients, of which the highest is K(z, z).
//
// The circle closes, so what lies at its end may as well lie before its beginning. In the last part of it, the wrapping
// zone, where no depth lies, a mass counts as in front of all by a share that grows from 0 to 1.
// The wrapping zone is pi / 10. Half the way to its middle, pi / 2 - WRAPPING / 4: and its cosine and sine. Where the zone
// begins, cos phi + sin phi.
#define HALF_WAY 0x1.7e0486p+0f
#define HALF_WAY_COS 0x1.415e54p-4f
#define HALF_WAY_SIN 0x1.fe6bf2p-1f
#define WRAPPING_BEGIN 0x1.48b968p-1f

typedef struct { VECTOR(float) re, im; } Complex;

INLINE void multiply(const Complex *a, const Complex *b, Complex *product)
{
    Complex result = {a->re * b->re - a->im * b->im, a->re * b->im + a->im * b->re};
    *product = result;
}
INLINE VECTOR(float) square_of(const Complex *a) { return a->re * a->re + a->im * a->im; }

// p[1](w) = w - first,   p[2](w) = w^2 + middle w - last;   share: 1 / D[j], for j = 1 and 2.
typedef struct { Complex first, middle, last; VECTOR(float) share[2]; } Curve;

// e^(i phi / 2), for phi of a depth. Series of sine and cosine for +-HALF_WAY: what is left out is below 2^-30.
INLINE void midway_to(VECTOR(float) place, Complex *midway)
{
    VECTOR(float) x = place * HALF_WAY, y = x * x;
    VECTOR(float) sine = y * (1.0f / 6227020800.0f) - (1.0f / 39916800.0f);
    sine = sine * y + (1.0f / 362880);
    sine = sine * y - (1.0f / 5040);
    sine = sine * y + (1.0f / 120);
    sine = sine * y - (1.0f / 6);
    sine = sine * y * x + x;
    VECTOR(float) cosine = (1.0f / 479001600) - y * (1.0f / 87178291200.0f);
    cosine = cosine * y - (1.0f / 3628800);
    cosine = cosine * y + (1.0f / 40320);
    cosine = cosine * y - (1.0f / 720);
    cosine = cosine * y + (1.0f / 24);
    cosine = cosine * y - 0.5f;
    cosine = cosine * y + 1.0f;
    midway->re = cosine * HALF_WAY_COS - sine * HALF_WAY_SIN;
    midway->im = sine * HALF_WAY_COS + cosine * HALF_WAY_SIN;
}

// e^(i phi) and e^(2 i phi), as four numbers.
INLINE void powers_of(VECTOR(float) place, VECTOR(float) *power)
{
    Complex midway, once, twice;
    midway_to(place, &midway);
    multiply(&midway, &midway, &once);
    multiply(&once, &once, &twice);
    power[0] = once.re, power[1] = once.im, power[2] = twice.re, power[3] = twice.im;
}

INLINE void find_curve(const VECTOR(float) *b, Curve *curve)
{
    Complex once = {b[0], b[1]}, twice = {b[2], b[3]}, square, other;
    multiply(&once, &once, &square);
    VECTOR(float) norm = MAX(1.0f - square_of(&once), (VECTOR(float))(0x1p-24f));
    Complex last = {(twice.re - square.re) / norm, (twice.im - square.im) / norm}, back = {once.re, -once.im};
    multiply(&last, &back, &other);
    curve->first = once, curve->last = last;
    curve->middle.re = other.re - once.re, curve->middle.im = other.im - once.im;
    curve->share[0] = 1.0f / norm;
    curve->share[1] = 1.0f / (norm * MAX(1.0f - square_of(&last), (VECTOR(float))(0x1p-24f)));
}

// p[1] and p[2] at a point.
INLINE void polynomials_at(const Curve *curve, const Complex *point, Complex *one, Complex *two)
{
    Complex sum = {point->re + curve->middle.re, point->im + curve->middle.im};
    multiply(&sum, point, two);
    two->re -= curve->last.re, two->im -= curve->last.im;
    one->re = point->re - curve->first.re, one->im = point->im - curve->first.im;
}

// K(w, w), which is 1 over the mass at w.
INLINE VECTOR(float) kernel_of(const Curve *curve, const Complex *one, const Complex *two)
{
    return 1.0f + square_of(one) * curve->share[0] + square_of(two) * curve->share[1];
}

// Which share of all absorbance lies in front of a depth, as in moments-power.h.
INLINE VECTOR(float) share_before(const Curve *curve, VECTOR(float) place, float overestimation)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f);
    Complex midway, point, one, two, low, high, turned, part;
    midway_to(place, &midway);
    multiply(&midway, &midway, &point);
    polynomials_at(curve, &point, &one, &two);
    VECTOR(float) at_point = 1.0f / kernel_of(curve, &one, &two);
    // K by powers of e^(i delta): low, middle, high. All come from the same two factors, so what rounding does to a factor
    // leaves the roots where its polynomial is zero. In theory low is conj(high), and middle is real.
    one.re *= curve->share[0], one.im *= -curve->share[0], two.re *= curve->share[1], two.im *= -curve->share[1];
    multiply(&one, &curve->first, &low);
    multiply(&two, &curve->last, &part);
    low.re = 1.0f - low.re - part.re, low.im = -low.im - part.im;
    multiply(&two, &point, &turned);
    multiply(&turned, &point, &high);
    multiply(&turned, &curve->middle, &part);
    VECTOR(float) middle = one.re * point.re - one.im * point.im + part.re;
    VECTOR(float) even = high.re + low.re, odd = high.im - low.im;
    VECTOR(float) whole = MAX(middle + even, (VECTOR(float))(1.0f));
    VECTOR(float) coefficients[2] = {-2.0f * odd / whole, (middle - even) / whole}, u[2];
    quadratic_roots(coefficients, u);
    VECTOR(float) share = overestimation * at_point;
    UNROLL for (int k = 0; k < 2; ++k) {
        // A root lies before the point if delta is more than 2 pi - phi.
        VECTOR(float) in_front = u[k] * midway.im < -midway.re ? (VECTOR(float))(1.0f) : zero;
        VECTOR(float) scale = 1.0f / (u[k] * u[k] + 1.0f);
        Complex turn = {1.0f - 2.0f * scale, 2.0f * u[k] * scale}, root;
        multiply(&turn, &point, &root);
        polynomials_at(curve, &root, &one, &two);
        VECTOR(float) ramp = (root.re + root.im - WRAPPING_BEGIN) * (1.0f / (1.0f - WRAPPING_BEGIN));
        ramp = root.re > zero && root.im < zero ? MAX(ramp, zero) : zero;
        share += (in_front + ramp) / kernel_of(curve, &one, &two);
    }
    return MIN(share, (VECTOR(float))(1.0f));
}
