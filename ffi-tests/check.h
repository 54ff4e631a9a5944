/* A test program is a list of functions; a failed check leaves its function. C11 and C++17. */

#ifndef CHECK_H
#define CHECK_H

#include <math.h>
#include <stdio.h>
#include <string.h>

static int check_passed = 0;
static int check_failed = 0;
static int check_here = 0;

#define CHECK(condition)                                                        \
    do {                                                                        \
        if (!(condition)) {                                                     \
            printf("%s:%d: failed: %s\n", __FILE__, __LINE__, #condition);      \
            check_here = 1;                                                     \
            return;                                                             \
        }                                                                       \
    } while (0)

/* Residual and tolerance are shown, whether the check passes or not. */
#define CHECK_NEAR(value, wanted, tolerance)                                                 \
    do {                                                                                     \
        const double residual_ = fabs((value) - (wanted));                                   \
        printf("    %s: residual %.3e, tolerance %.3e\n", #value, residual_, (double)(tolerance)); \
        CHECK(residual_ <= (tolerance));                                                     \
    } while (0)

#define RUN(test)                                       \
    do {                                                \
        check_here = 0;                                 \
        test();                                         \
        printf("%s %s\n", check_here ? "FAILED" : "ok", #test); \
        if (check_here) ++check_failed; else ++check_passed;   \
    } while (0)

/* The line that the runner reads. */
static inline int check_summary(void) {
    printf("%d passed, %d failed\n", check_passed, check_failed);
    return check_failed == 0 ? 0 : 1;
}

#endif
