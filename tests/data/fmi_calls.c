// Calls of a unit for co-simulation, right and wrong ones: TOKEN, the number of value references,
// and y where it has derivatives. Returns 0, or the line of the first call that gave something else than it should.

#include "fmi3Functions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define GIVES(status, call)                                                                        \
    do {                                                                                           \
        if ((call) != status)                                                                      \
            return __LINE__;                                                                       \
    } while (0)
#define NEED(call) GIVES(fmi3OK, call)
#define FAIL(call) GIVES(fmi3Error, call)

static void note(fmi3InstanceEnvironment place, fmi3Status status, fmi3String category,
    fmi3String message)
{
    (void)category;
    *(int *)place += status == fmi3Error;
    puts(message);
}

static fmi3Status step(fmi3Instance unit, double t, double h)
{
    fmi3Boolean has_event, terminates, is_early;
    double last;
    return fmi3DoStep(unit, t, h, fmi3False, &has_event, &terminates, &is_early, &last);
}

static int run(fmi3Instance unit, fmi3ValueReference all, int turn, bool has_derivatives)
{
    const fmi3ValueReference one = 1, beyond = 100 * all;
    const double bad[] = { NAN, NAN };
    double x;
    int32_t number;
    bool is_ticking;
    size_t size;
    fmi3FMUState kept = NULL, again = NULL;
    NEED(fmi3EnterInitializationMode(unit, false, 0, 0, false, 0));
    NEED(fmi3ExitInitializationMode(unit));
    NEED(fmi3GetFMUState(unit, &kept));
    NEED(step(unit, 0, 0.3));
    for (fmi3ValueReference place = 0; place < all; place++)
        NEED(fmi3GetFloat64(unit, &place, 1, &x, 1));
    if (turn == 0)
        FAIL(fmi3GetFloat64(unit, &beyond, 1, &x, 1));
    else if (turn == 1)
        FAIL(fmi3SetFloat64(unit, &one, 1, bad, 2));
    else
        FAIL(step(unit, 0.3, -1));
    FAIL(step(unit, 0.3, 0.1));
    NEED(fmi3SetFMUState(unit, kept));
    NEED(fmi3SerializedFMUStateSize(unit, kept, &size));
    fmi3Byte *bytes = malloc(size);
    NEED(fmi3SerializeFMUState(unit, kept, bytes, size));
    NEED(fmi3DeserializeFMUState(unit, bytes, size, &again));
    NEED(fmi3SetFMUState(unit, again));
    NEED(step(unit, 0, 0.3));
    FAIL(fmi3DeserializeFMUState(unit, bytes, size - 1, &again));
    NEED(fmi3Reset(unit));
    FAIL(fmi3DeserializeFMUState(unit, NULL, size, &again));
    NEED(fmi3Reset(unit));
    FAIL(fmi3SerializeFMUState(unit, kept, bytes, size - 1));
    FAIL(fmi3GetInt32(unit, &one, 1, &number, 1));
    FAIL(fmi3GetClock(unit, &one, 1, &is_ticking));
    FAIL(fmi3GetFloat64(unit, NULL, 1, NULL, 1));
    FAIL(fmi3SetFMUState(unit, NULL));
    NEED(fmi3GetFloat64(unit, NULL, 0, NULL, 0));
    NEED(fmi3FreeFMUState(unit, &kept));
    NEED(fmi3FreeFMUState(unit, &again));
    NEED(fmi3FreeFMUState(unit, NULL)); // is ignored, as FMI 3.0 says
    NEED(fmi3Reset(unit));
    if (has_derivatives) {
        NEED(fmi3EnterInitializationMode(unit, false, 0, 0, false, 0));
        NEED(fmi3GetDirectionalDerivative(unit, NULL, 0, NULL, 0, NULL, 0, NULL, 0));
        NEED(fmi3GetAdjointDerivative(unit, NULL, 0, &one, 1, NULL, 0, &x, 1));
        FAIL(fmi3GetAdjointDerivative(unit, NULL, 1, NULL, 1, NULL, 1, NULL, 1));
    } else
        FAIL(fmi3GetAdjointDerivative(unit, NULL, 0, NULL, 0, NULL, 0, NULL, 0));
    NEED(fmi3Reset(unit));
    free(bytes);
    return 0;
}

static fmi3Instance made(fmi3String token, int *said)
{
    return fmi3InstantiateCoSimulation(
        "a", token, NULL, false, false, false, false, NULL, 0, said, note, NULL);
}

int main(int count, char **given)
{
    (void)count;
    int said = 0;
    if (made(NULL, &said) || said != 1)
        return __LINE__;
    fmi3Instance unit = made(given[1], &said), other = made(given[1], &said);
    if (!unit || !other)
        return __LINE__;
    for (int turn = 0; turn < 3; turn++) {
        const int line = run(
            turn % 2 ? other : unit, (fmi3ValueReference)atoi(given[2]), turn, *given[3] == 'y');
        if (line)
            return line;
    }
    fmi3FreeInstance(unit);
    fmi3FreeInstance(other);
    fmi3FreeInstance(NULL);
    FAIL(fmi3Reset(NULL));
    return said == 1 + 3 * 10 ? 0 : __LINE__;
}
