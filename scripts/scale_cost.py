"""What many frames cost, from measured rates: core hours, days on so many cores, money.

    python3 scripts/scale_cost.py --rate label=90 --rate run=1.2 [--frames 10000000] [--cores 64] [--price 0.04]

A rate is in frames a second and core, as the commands of docs/scale.md measure it on the machine in question. The price
of a core hour is the reader's: the default is an example, not an offer of anyone.
"""

import argparse


def rate(text):
    name, _, value = text.partition("=")
    if not name or not value or not float(value) > 0:
        raise argparse.ArgumentTypeError(f"`{text}` is no NAME=FRAMES_A_SECOND_AND_CORE")
    return name, float(value)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--rate", type=rate, action="append", required=True, metavar="NAME=RATE")
parser.add_argument("--frames", type=float, default=10e6)
parser.add_argument("--cores", type=int, default=64)
parser.add_argument("--price", type=float, default=0.04, help="of a core hour; an example (default: %(default)s)")
parser.add_argument("--efficiency", type=float, default=1.0, help="share of a core's rate that remains with many")
given = parser.parse_args()

print(f"| {given.frames:,.0f} frames | frames / s and core | core hours | hours on {given.cores} cores | cost at {given.price} an hour |")
print("|---|---|---|---|---|")
for name, value in given.rate:
    hours = given.frames / (value * given.efficiency) / 3600
    print(f"| {name} | {value:g} | {hours:,.0f} | {hours / given.cores:,.1f} | {hours * given.price:,.2f} |")
