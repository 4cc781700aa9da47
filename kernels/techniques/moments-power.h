// Power moments: 4, 6 or 8 of them say how absorbance is spread over depth (moments.cl).
//
// b[k] is the sum of Ai zi^k over that of Ai, with absorbances Ai at depths zi from -1 to 1. Of all the ways to spread
// absorbance that have these moments, there is one that has the most of it at z, and the least in front: the canonical
// representation, with one mass at z and n others, where 2 n is the number of moments (Muenstermann et al. 2018, section
// 3.2 and algorithm 1; Akhiezer, The Classical Moment Problem, 1965). So at least the masses in front of z lie in front
// of it, and at most these and the mass at z.
//
// The paper solves the moments' Hankel matrix for the polynomial whose roots are the places of the n other masses. Here the
// same is done by the polynomials that are orthogonal under the moments, p[0] to p[n], as these are less sensitive to
// rounding:
//   kernel    K(x, y) = sum over j of p[j](x) p[j](y) / D[j],  with D[j] = the moments' value of p[j]^2
//   places    the roots of K(z, .)
//   masses    1 / K(x, x) at each place x, and at z itself
// Places may lie anywhere, even at infinity. So the roots are found as u = 1 / (place - z). The highest coefficient is K(z, z)
// then, which is 1 or more. Masses in front of z have u < 0.
// Masses farther than 2^20 away are moved there. They are next to nothing.
#define FARTHEST -0x1p-20f

// D[j] is at least this, for moments that rounding has made those of nothing.
#define LEAST_NORM 0x1p-40f

// p[j + 1](x) = (x - center[j]) p[j](x) - step[j] p[j - 1](x).   share: 1 / D[j].
typedef struct { VECTOR(float) center[ORDER], step[ORDER], share[ORDER + 1]; } Curve;

// The powers of a depth: z, z^2, ...
INLINE void powers_of(VECTOR(float) place, VECTOR(float) *power)
{
    power[0] = place;
    UNROLL for (int k = 1; k < MOMENTS; ++k) power[k] = power[k - 1] * place;
}

// Chebyshev's algorithm (1859): from moments to orthogonal polynomials. row[k], before[k]: the moments' value of
// p[j] x^k, and of p[j - 1] x^k.
INLINE void find_curve(const VECTOR(float) *b, Curve *curve)
{
    VECTOR(float) row[MOMENTS + 1], before[MOMENTS + 1];
    row[0] = (VECTOR(float))(1.0f);
    UNROLL for (int k = 1; k <= MOMENTS; ++k) row[k] = b[k - 1];
    UNROLL for (int k = 0; k <= MOMENTS; ++k) before[k] = (VECTOR(float))(0.0f);
    VECTOR(float) norm = row[0], ratio = (VECTOR(float))(0.0f);
    curve->step[0] = (VECTOR(float))(0.0f);
    curve->share[0] = row[0];
    UNROLL for (int j = 0; j < ORDER; ++j) {
        VECTOR(float) next = row[j + 1] / norm;
        curve->center[j] = next - ratio;
        ratio = next;
        UNROLL for (int k = j + 1; k < MOMENTS - j; ++k) {
            VECTOR(float) own = row[k];
            row[k] = row[k + 1] - curve->center[j] * own - curve->step[j] * before[k];
            before[k] = own;
        }
        VECTOR(float) found = MAX(row[j + 1], (VECTOR(float))(LEAST_NORM));
        row[j + 1] = found;
        curve->share[j + 1] = 1.0f / found;
        if (j + 1 < ORDER) curve->step[j + 1] = found / norm;
        norm = found;
    }
}

// The mass at x: 1 / K(x, x).
INLINE VECTOR(float) mass_at(const Curve *curve, VECTOR(float) x)
{
    VECTOR(float) before = (VECTOR(float))(0.0f), value = (VECTOR(float))(1.0f), sum = value;
    UNROLL for (int j = 0; j < ORDER; ++j) {
        VECTOR(float) next = (x - curve->center[j]) * value - curve->step[j] * before;
        before = value, value = next;
        sum += value * value * curve->share[j + 1];
    }
    return 1.0f / sum;
}

// Which share of all absorbance lies in front of z: the least there may be, and `overestimation` of what may be besides.
INLINE VECTOR(float) share_before(const Curve *curve, VECTOR(float) z, float overestimation)
{
    // The coefficients of p[j](z + t) by powers of t, and those of K(z, z + t).
    VECTOR(float) own[ORDER + 1], before[ORDER + 1], kernel_at[ORDER + 1];
    UNROLL for (int k = 0; k <= ORDER; ++k) own[k] = before[k] = kernel_at[k] = (VECTOR(float))(0.0f);
    own[0] = kernel_at[0] = (VECTOR(float))(1.0f);
    UNROLL for (int j = 0; j < ORDER; ++j) {
        VECTOR(float) apart = z - curve->center[j];
        UNROLL for (int k = j + 1; k >= 0; --k) {
            VECTOR(float) next = k ? own[k - 1] : (VECTOR(float))(0.0f);
            if (k <= j) next += apart * own[k];
            if (k < j) next -= curve->step[j] * before[k];
            before[k] = next;
        }
        UNROLL for (int k = 0; k <= j + 1; ++k) {
            VECTOR(float) next = before[k];
            before[k] = own[k], own[k] = next;
        }
        VECTOR(float) factor = own[0] * curve->share[j + 1];
        UNROLL for (int k = 0; k <= j + 1; ++k) kernel_at[k] += factor * own[k];
    }
    VECTOR(float) coefficients[ORDER], u[ORDER], at_z = 1.0f / kernel_at[0];
    UNROLL for (int k = 0; k < ORDER; ++k) coefficients[k] = kernel_at[k + 1] / kernel_at[0];
#if ORDER == 2
    quadratic_roots(coefficients, u);
#else
    real_roots(coefficients, u);
#endif
    VECTOR(float) share = overestimation * at_z;
    UNROLL for (int k = 0; k < ORDER; ++k) {
        VECTOR(int) in_front = u[k] < (VECTOR(float))(0.0f);
        VECTOR(float) mass = mass_at(curve, z + 1.0f / MIN(u[k], (VECTOR(float))(FARTHEST)));
        share += in_front ? mass : (VECTOR(float))(0.0f);
    }
    return MIN(share, (VECTOR(float))(1.0f));
}
