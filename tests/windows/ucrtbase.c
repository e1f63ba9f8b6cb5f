// SPDX-License-Identifier: GPL-3.0-or-later
// What Wine 8's C runtime lacks, as far as NumPy 2 asks for it: functions of complex numbers, by MinGW's.
#include <complex.h>

typedef struct { float part[2]; } FloatPair;
typedef struct { double part[2]; } DoublePair;

static float complex float_of(FloatPair z) { return z.part[0] + z.part[1] * I; }
static double complex double_of(DoublePair z) { return z.part[0] + z.part[1] * I; }
static FloatPair float_pair(float complex z) { return (FloatPair){{crealf(z), cimagf(z)}}; }
static DoublePair double_pair(double complex z) { return (DoublePair){{creal(z), cimag(z)}}; }

// Each as our_NAME: the linker's list of exports gives them their names.
#define REAL(name)                                                                  \
  float our_##name##f(FloatPair z) { return name##f(float_of(z)); }                 \
  double our_##name(DoublePair z) { return name(double_of(z)); }
#define COMPLEX(name)                                                               \
  FloatPair our_##name##f(FloatPair z) { return float_pair(name##f(float_of(z))); } \
  DoublePair our_##name(DoublePair z) { return double_pair(name(double_of(z))); }

REAL(cabs)
REAL(carg)
REAL(cimag)
REAL(creal)
COMPLEX(catan)
COMPLEX(ccos)
COMPLEX(ccosh)
COMPLEX(cexp)
COMPLEX(clog)
COMPLEX(csin)
COMPLEX(csinh)
COMPLEX(csqrt)
COMPLEX(ctan)
COMPLEX(ctanh)
#define COMPLEX2(name)                                                                                       \
  FloatPair our_##name##f(FloatPair a, FloatPair b) { return float_pair(name##f(float_of(a), float_of(b))); } \
  DoublePair our_##name(DoublePair a, DoublePair b) { return double_pair(name(double_of(a), double_of(b))); }
COMPLEX2(cpow)
