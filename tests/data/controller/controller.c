// A control loop on a Cortex-M4, and what it takes: prints, in hexadecimal, the status and all
// numbers of each step; then the clock's ticks of all steps, of 40 instructions each, and the bytes
// of stack of the deepest. `calls.h`, made by the test, says what is called.

#include <stdint.h>
#include <string.h>

#include "calls.h"

extern uint32_t stack_end, stack_begin;
int main(void);
void reset(void);

__attribute__((section(".vectors"), used)) static void *const VECTORS[] = { &stack_begin, (void *)reset };

#define REGISTER(place) (*(volatile uint32_t *)(place))

// Semihosting: what the machine asks of QEMU.
static void ask(uint32_t operation, uint32_t given)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = given;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void print(uint32_t number)
{
    char text[] = "00000000 ";
    for (int k = 0; k < 8; k++)
        text[k] = "0123456789abcdef"[number >> (28 - 4 * k) & 15];
    ask(0x04, (uint32_t)text);
}

static void print_floats(const float *from, int count)
{
    for (int k = 0; k < count; k++) {
        uint32_t bits;
        memcpy(&bits, &from[k], sizeof bits);
        print(bits);
    }
}

static STATE state;

void reset(void)
{
    REGISTER(0xe000ed88) |= 0xf << 20;  // the unit of floating-point numbers is on
    main();
    ask(0x18, 0x20026);
}

static uint32_t *here(void)
{
    return (uint32_t *)__builtin_frame_address(0);
}

// Follow the motion; apart, so that its frame is below that of `main`.
__attribute__((noinline)) static uint32_t follow(void)
{
    uint32_t ticks = 0;
    for (int k = 0; k < COUNT; k++) {
        REGISTER(0xe000e018) = 0;
        const uint32_t before = REGISTER(0xe000e018);
        const int status = k == 0 ? START(&state) : STEP(&state, (float)k * INTERVAL);
        ticks += k == 0 ? 0 : (before - REGISTER(0xe000e018)) & 0xffffff;
        print((uint32_t)status);
        PRINT(&state);
        ask(0x04, (uint32_t)"\n");
    }
    return ticks;
}

int main(void)
{
    REGISTER(0xe000e014) = 0xffffff;  // the clock counts down
    REGISTER(0xe000e010) = 5;
    uint32_t *first = here() - 32;
    for (uint32_t *k = &stack_end; k < first; k++)
        *k = 0xa5a5a5a5;
    const uint32_t ticks = follow();
    uint32_t *last = &stack_end;
    while (*last == 0xa5a5a5a5)
        last++;
    print(ticks);
    print((uint32_t)((char *)first - (char *)last));
    ask(0x04, (uint32_t)"\n");
    return 0;
}
