// Adding as the papers' hardware does it: one geometry pass with additive blending into targets in the device's memory,
// then one launch over all pixels.
//
//   begin_sums        over pixels: the targets before the pass
//   count_depth       over fragments: the depth complexity n, by atomics
//   blend_in_order    over the stream, a lane's pixels a work-item: the sums
//   merge_sums        over tiles: weighs the sums and composites the picture
//
// Blending hardware adds the fragments of a pixel in the order of submission. Sums of floats depend on their order, and
// with it on what a target of few bits rounds off. Atomics keep no order. So the sums have a launch of their own after
// the one that counts: like a raster unit, each work-item goes through the fragments of its own pixels as they come.
//
//   sums    the colours of each strip, as sum(Ai Ci) and sum(Ai)
//   depth   n, of each pixel
#ifndef ADD_PASSES_H
#define ADD_PASSES_H

kernel void begin_sums(uint strips, global Colors *sums, global uint *depth)
{
    uint strip = get_global_id(0);
    if (strip >= strips) return;
    Colors none;
    clear_sums(&none);
    sums[strip] = none;
    for (uint k = 0; k < STRIP; ++k) depth[strip * STRIP + k] = 0;
}

kernel void count_depth(uint count, global const uint *pixels, volatile global uint *depth)
{
    uint first = get_global_id(0) * STRIP;
    for (uint at = first; at < MIN(first + STRIP, count); ++at) atomic_inc(depth + pixels[at]);
}

// first_tile, first_pixel, last_pixel, pixel_end, tile_start, run_start: as in stages/stream.cl.
kernel void blend_in_order(uint first_tile, uint first_pixel, uint last_pixel, global const uint *pixel_end,
                           global const uint *tile_start, uint run_start, global const ulong *fragments,
                           global const uint *pixels, global const void *colors_of_fragments, global Colors *sums)
{
    const uint own = TILE_PIXELS / LANES;
    uint tile = first_tile + get_group_id(0), first = MAX(LANE * own, first_pixel), last = MIN(LANE * own + own - 1, last_pixel);
    if (first > last) return;
    global const uint *ends = pixel_end + tile * TILE_PIXELS;
    uint start = tile_start[tile] - run_start, end = start + ends[last];
    for (uint at = start + (first ? ends[first - 1] : 0); at < end; ++at) {
        uint pixel = pixels[at], payload = (uint)fragments[at];
        float4 color = fragment_color(colors_of_fragments, payload);
        VECTOR(int) here = (VECTOR(int))(IOTA) == (VECTOR(int))(pixel % STRIP);
        const VECTOR(float) zero = (VECTOR(float))(0.0f);
        Colors source = {here ? color.x : zero, here ? color.y : zero, here ? color.z : zero, here ? color.w : zero};
        Colors buffer = sums[pixel / STRIP];
        blend_add(&buffer, &source);
        sums[pixel / STRIP] = buffer;
    }
}

// first_tile, behind: see frames/peel_passes.h. tile_layers: the depth complexity of each tile's deepest pixel.
kernel void merge_sums(Screen screen, uint first_tile, global const Colors *sums, global const uint *depth, global const Colors *behind,
                       global uint *tile_layers, int side_bits, global const float4 *background, int gradient,
                       global const uint *scales, volatile global uint *clamped, global uint *image, global float4 *color)
{
    local Colors layer[TILE_PIXELS / STRIP];
    local uint deepest;
    uint tile = get_group_id(0), most = 0;
    if (LANE == 0) deepest = 0;
    BARRIER;
    for (int own = 0; own < STRIPS_A_LANE; ++own) {
        uint place = own * LANES + LANE, strip = tile * (TILE_PIXELS / STRIP) + place;
        VECTOR(uint) count = *(global const VECTOR(uint) *)(depth + strip * STRIP);
        Colors buffer = sums[strip], resolved;
        read_color(&buffer, &resolved);
        weigh(count, &resolved);
        if (MIXED) {
            Colors under = behind[first_tile * (TILE_PIXELS / STRIP) + strip];
            put_over(&resolved, &under);
        }
        most = MAX(most, largest(count));
        layer[place] = resolved;
    }
    atomic_max(&deepest, most);
    BARRIER;
    if (LANE == 0) tile_layers[tile] = deepest;
    uint beyond_one = composite_tile(layer, screen.first_tile + first_tile + tile, screen.columns, side_bits, screen.width,
                                     screen.height, background, gradient, scales, image, color);
    if (beyond_one) atomic_add(clamped, beyond_one);
}

#endif
