"""The ready systems under the names of the command line."""

#: plain descriptions by name; each system is made by a function of `sklearn_pgnn.systems`
SYSTEMS = {
    "cart-on-spring": "Cart on a spring",
    "golf-robot": "Golf robot (driven pendulum)",
    "servo-valve": "Servo valve",
    "two-tanks": "Two tanks",
}


def make_system(name: str):
    """Return a ready system.

    Its name is a key of `SYSTEMS`.
    """
    from sklearn_pgnn import systems  # loads sympy, which most commands' help does without

    return getattr(systems, name.replace("-", "_"))()
