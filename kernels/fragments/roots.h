// Roots: square roots of strips, and the roots of polynomials of which all roots are real.
#ifndef ROOTS_H
#define ROOTS_H

#include "base/common.h"

// The square root, or 0 of numbers that rounding has made negative.
INLINE VECTOR(float) root_of(VECTOR(float) square)
{
    VECTOR(float) some = MAX(square, (VECTOR(float))(0.0f)), root;
#if CPU_TARGET && __has_builtin(__builtin_sqrtf)
    UNROLL for (int k = 0; k < STRIP; ++k) ((float *)&root)[k] = __builtin_sqrtf(((const float *)&some)[k]);
#else
    UNROLL for (int k = 0; k < STRIP; ++k) ((float *)&root)[k] = sqrt(((const float *)&some)[k]);
#endif
    return root;
}

// above / below, or 0 where there is nothing to divide by.
INLINE VECTOR(float) quotient(VECTOR(float) above, VECTOR(float) below)
{
    VECTOR(int) some = below != (VECTOR(float))(0.0f);
    return some ? above / (some ? below : (VECTOR(float))(1.0f)) : (VECTOR(float))(0.0f);
}

// The roots of x^2 + a[0] x + a[1]. The greater one is a sum of numbers of one sign, and their product gives the other.
INLINE void quadratic_roots(const VECTOR(float) *a, VECTOR(float) *x)
{
    VECTOR(float) middle = -0.5f * a[0], apart = root_of(middle * middle - a[1]);
    x[0] = middle + (middle < (VECTOR(float))(0.0f) ? -apart : apart);
    x[1] = quotient(a[1], x[0]);
}

#define LAGUERRE_STEPS 5
#define NEWTON_STEPS 2

// One step of Laguerre's method for x^n + a[0] x^(n - 1) + ... + a[n - 1], with all roots on one side of x. It does not
// pass the nearest root, and triples the digits that are right.
INLINE VECTOR(float) laguerre_step(const VECTOR(float) *a, int n, VECTOR(float) x)
{
    VECTOR(float) value = (VECTOR(float))(1.0f), slope = (VECTOR(float))(0.0f), bend = slope;  // bend: half the second
    UNROLL for (int k = 0; k < n; ++k) {
        bend = bend * x + slope;
        slope = slope * x + value;
        value = value * x + a[k];
    }
    VECTOR(float) least = root_of((float)(n - 1) * ((float)(n - 1) * slope * slope - (float)(2 * n) * value * bend));
    return x - quotient((float)n * value, slope + (slope < (VECTOR(float))(0.0f) ? -least : least));
}

INLINE VECTOR(float) newton_step(const VECTOR(float) *a, int n, VECTOR(float) x)
{
    VECTOR(float) value = (VECTOR(float))(1.0f), slope = (VECTOR(float))(0.0f);
    UNROLL for (int k = 0; k < n; ++k) {
        slope = slope * x + value;
        value = value * x + a[k];
    }
    return x - quotient(value, slope);
}

// The roots of x^n + a[0] x^(n - 1) + ... + a[n - 1], all of them real; n is ROOTS, from 2 to 4.
//
// The root of greatest magnitude is found first, and divided out; and so on, until a quadratic is left. The search
// begins at a bound of all roots, which follows from the sum of the roots and that of their squares (Samuelson 1968). A
// polynomial is divided from its last coefficient on, which is stable for the greatest root. What dividing has rounded,
// Newton's steps with all coefficients put right.
INLINE void real_roots(const VECTOR(float) *a, VECTOR(float) *x)
{
    VECTOR(float) left[ROOTS];
    UNROLL for (int k = 0; k < ROOTS; ++k) left[k] = a[k];
    UNROLL for (int n = ROOTS; n > 2; --n) {
        VECTOR(float) mean = left[0] * (-1.0f / n), square = left[0] * left[0] * (float)((n - 1) * (n - 1));
        VECTOR(float) reach = root_of(square - (float)(2 * n * (n - 1)) * left[1]) * (1.0f / n);
        VECTOR(float) root = mean + (mean < (VECTOR(float))(0.0f) ? -reach : reach);
        UNROLL for (int step = 0; step < LAGUERRE_STEPS; ++step) root = laguerre_step(left, n, root);
        x[n - 1] = root;
        VECTOR(float) divided = -quotient(left[n - 1], root);
        UNROLL for (int k = n - 2; k > 0; --k) {
            VECTOR(float) whole = left[k];
            left[k] = divided;
            divided = quotient(divided - whole, root);
        }
        left[0] = divided;
    }
    quadratic_roots(left, x);
#if ROOTS > 2
    UNROLL for (int k = 0; k < ROOTS; ++k)
        UNROLL for (int step = 0; step < NEWTON_STEPS; ++step) x[k] = newton_step(a, ROOTS, x[k]);
#endif
}

#endif
