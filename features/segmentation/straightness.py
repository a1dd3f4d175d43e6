# pyright: standard
"""Straightness: whether the points of a segment lie on one line, and how far they may bend away from it."""

import math

from features.compiled import inner
from features.segmentation.breaks import fit_rough

SUMS = {"reassoc", "contract", "arcp", "nsz"}
"""Optimisations that let the compiler vectorise sums; NaN and infinity are handled as ever."""

SINGULAR = 1e-12
"""A determinant smaller than this share of the product of its diagonal is rounding error."""

PARALLEL = 0.5
"""A beam meets a line if its point is within this share of the distance that it goes towards the line."""


@inner()
def split_crooked(xs, ys, segments, count, noise, rules, sums, stack, pieces):
    """Split each segment whose points two lines explain better than one, by more than chance (eq. M101).

    Fills the pieces and returns their number. A piece is joined to the next one of its segment.
    """
    found = 0
    for k in range(count):
        first = segments[k].first
        begin = segments[k].begin
        stack[0] = segments[k].last
        waiting = 1
        while waiting > 0:
            last = stack[waiting - 1]
            whole = last == segments[k].last
            piece = pieces[found]
            piece.first = first
            piece.last = last
            piece.begin = begin
            piece.end = segments[k].end if whole else last
            piece.joined = segments[k].joined if whole else 1
            fit_rough(xs, ys, piece)
            gain, index = best_break(xs, ys, piece, noise, sums)
            if gain > 2.0 * math.log(max(piece.end - piece.begin + 1, 1) / rules.straight_level):
                # The later part waits.
                stack[waiting] = index
                waiting += 1
                continue
            found += 1
            waiting -= 1
            first = begin = last + 1
    return found


@inner(fastmath=SUMS, forceinline=True)
def best_break(xs, ys, segment, noise, sums):
    """Find where two lines, each of two points or more, explain the points of a segment best in place of one.

    Returns
    -------
    gain : how much the sum of the squared, normalised residuals falls (eq. M101); 0 for fewer than four points.
    index : last point of the first of the two lines.
    """
    begin = segment.begin
    n = segment.end - begin + 1
    if n < 4:
        return 0.0, begin
    normal_x, normal_y, offset = segment.normal_x, segment.normal_y, segment.offset
    _, along_0, _ = residual(xs[begin], ys[begin], normal_x, normal_y, offset, 0.0, noise)
    xs = xs[begin : begin + n]
    ys = ys[begin : begin + n]
    weights, alongs, residuals, gains = sums[5, :n], sums[6, :n], sums[7, :n], sums[8, :n]
    for i in range(n):
        weights[i], alongs[i], residuals[i] = residual(xs[i], ys[i], normal_x, normal_y, offset, along_0, noise)
    w_sum = ws_sum = wss_sum = wr_sum = wrs_sum = 0.0
    for i in range(n):
        weight, along = weights[i], alongs[i]
        pull = weight * residuals[i]
        w_sum += weight
        ws_sum += weight * along
        wss_sum += weight * along * along
        wr_sum += pull
        wrs_sum += pull * along
        sums[0, i] = w_sum
        sums[1, i] = ws_sum
        sums[2, i] = wss_sum
        sums[3, i] = wr_sum
        sums[4, i] = wrs_sum
    for i in range(1, n - 2):
        w, ws, wss, wr, wrs = sums[0, i], sums[1, i], sums[2, i], sums[3, i], sums[4, i]
        gains[i] = explained(w, ws, wss, wr, wrs) + explained(
            w_sum - w, ws_sum - ws, wss_sum - wss, wr_sum - wr, wrs_sum - wrs
        )
    index = 1 + gains[1 : n - 2].argmax() if n > 3 else 0
    return gains[index] - explained(w_sum, ws_sum, wss_sum, wr_sum, wrs_sum), begin + index


@inner(fastmath=SUMS, forceinline=True)
def bend_of(xs, ys, segment, noise, rules):
    """Return how far the ends of a segment bend away from its line, where that is beyond chance [m] (eq. M102)."""
    normal_x, normal_y, offset = segment.normal_x, segment.normal_y, segment.offset
    _, along_0, _ = residual(xs[segment.begin], ys[segment.begin], normal_x, normal_y, offset, 0.0, noise)
    xs = xs[segment.begin : segment.end + 1]
    ys = ys[segment.begin : segment.end + 1]
    w_sum = ws_sum = wss_sum = wsss_sum = wssss_sum = wr_sum = wrs_sum = wrss_sum = s = 0.0
    for i in range(xs.size):
        w, s, r = residual(xs[i], ys[i], normal_x, normal_y, offset, along_0, noise)
        ws = w * s
        wss = ws * s
        w_sum += w
        ws_sum += ws
        wss_sum += wss
        wsss_sum += wss * s
        wssss_sum += wss * s * s
        wr_sum += w * r
        wrs_sum += ws * r
        wrss_sum += wss * r
    spread = w_sum * wss_sum - ws_sum * ws_sum
    if not spread > SINGULAR * w_sum * wss_sum:
        return 0.0
    # What the regression on 1 and s leaves of s^2.
    constant = (wss_sum * wss_sum - ws_sum * wsss_sum) / spread
    slope = (w_sum * wsss_sum - ws_sum * wss_sum) / spread
    left = wssss_sum - constant * wss_sum - slope * wsss_sum
    joint = wrss_sum - constant * wr_sum - slope * wrs_sum
    if not left > SINGULAR * wssss_sum or joint * joint <= rules.bend_sigmas * rules.bend_sigmas * left:
        return 0.0
    return abs(joint / left) * max(abs(constant), abs(s * s - constant - slope * s))


@inner(inline="always")
def residual(x, y, normal_x, normal_y, offset, along_0, noise):
    """Return weight, abscissa and residual of a point at a line.

    The abscissa is where the beam meets the line: that of the point has the same noise of the range as the residual,
    which an oblique line would explain by a slope wherever the beams are denser than the noise.
    """
    across = normal_x * x + normal_y * y
    along = normal_x * y - normal_y * x
    apart = across - offset
    # Nearly along the line a beam meets it anywhere.
    hit = along * (offset / across) if abs(apart) < PARALLEL * abs(across) else along
    # Eq. M3 times the squared range: sine and cosine of the incidence are the parts along and across, over the range.
    variance2 = noise[0] * across * across + noise[1] * along * along * (x * x + y * y)
    return (x * x + y * y) / variance2, hit - along_0, apart


@inner(inline="always")
def explained(w, ws, wss, wr, wrs):
    """Sum of squares that a weighted regression of residuals explains, of its five sums."""
    joint = w * wrs - ws * wr
    # Points at one place determine no slope; their spread is rounding error.
    spread = max(w * wss - ws * ws, SINGULAR * w * wss)
    return (wr * wr + joint * joint / spread) / w
