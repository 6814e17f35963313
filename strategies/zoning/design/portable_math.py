"""exp and ln of basic arithmetic only, so that every machine gets the same bits."""

from automaton.engine.jit.kernel import kernel

LN2 = 0.6931471805599453
EXP_UNDERFLOW = -700.0  # exp of less is 0


@kernel
def exponential(x):
    """e to the power of x, for x <= 0; relative error below 1e-14."""
    if x < EXP_UNDERFLOW:
        return 0.0
    halvings = int(-x / LN2 + 0.5)
    rest = x + halvings * LN2
    term = 1.0
    total = 1.0
    for k in range(1, 15):
        term = term * rest / k
        total += term
    for _ in range(halvings):
        total *= 0.5
    return total


@kernel
def logarithm(x):
    """The natural logarithm of x > 0."""
    doublings = 0
    while x < 0.75:
        x *= 2.0
        doublings -= 1
    while x > 1.5:
        x *= 0.5
        doublings += 1
    ratio = (x - 1.0) / (x + 1.0)
    square = ratio * ratio
    total = 0.0
    for k in range(20, -1, -1):
        total = total * square + 1.0 / (2 * k + 1)
    return 2.0 * ratio * total + doublings * LN2


@kernel
def temperature(hot, cold, steps, done):
    """Eq. 6: hot (cold / hot) ^ (done / steps)."""
    ratio = logarithm(cold / hot) * done / steps
    if ratio > 0.0:
        return hot / exponential(-ratio)
    return hot * exponential(ratio)
