// multi-layer-alpha-blending: keeps SLOTS layers of a pixel, and blends the two farthest into one where there are more.
//
// Salvi and Vaidyanathan (2014, "Multi-Layer Alpha Blending") insert each fragment, as it comes, into an array of layers
// that is sorted by depth. A layer is (Ai Ci, 1 - Ai, zi). Where one is too many, the last two become one:
//   (Ck + Tk Ck+1, Tk Tk+1, zk)
// This is right if nothing comes between the two later. What does is blended in front of both or behind both. So the
// picture is exact where a pixel has at most SLOTS layers, and depends on the order of submission elsewhere. No fragment
// has more than SLOTS - 2 of the nearest SLOTS - 1 in front of it. So these are never blended with others too early, and
// only what is seen through them may be wrong.
//
// At the end the layers are blended front to back. The buffers that are rounded (PRECISION) are those of the array.
#ifndef SLOTS
#define SLOTS 4
#endif
#include "frames/inserted.h"

typedef struct {
    Whole depth;
    Paint paint;  // premultiplied, and `alpha` is the transmittance
} Slot;
typedef struct { Slot slot[SLOTS]; } Nodes;

// Empty slots let all light through, and are behind all fragments. Blending one behind another layer changes nothing.
INLINE void clear_nodes(Nodes *nodes)
{
    UNROLL for (int i = 0; i < SLOTS; ++i) {
        Slot *slot = nodes->slot + i;
        slot->depth = (Whole)(~0u);
        slot->paint.red = slot->paint.green = slot->paint.blue = (Number)(0.0f);
        slot->paint.alpha = (Number)(FULL);
    }
}

INLINE void exchange_numbers(Truth turned, Number *a, Number *b)
{
    Number before = *a;
    *a = choose(turned, *b, before), *b = choose(turned, before, *b);
}

// From the first layer on that is behind the new one, each moves one place back. Of equal depths the one that was submitted
// first is in front.
INLINE void exchange_slots(Whole depth, Slot *slot, Slot *moving)
{
    Truth turned = depth < slot->depth;
    Whole before = slot->depth;
    slot->depth = turned ? moving->depth : before, moving->depth = turned ? before : moving->depth;
    exchange_numbers(turned, &slot->paint.red, &moving->paint.red);
    exchange_numbers(turned, &slot->paint.green, &moving->paint.green);
    exchange_numbers(turned, &slot->paint.blue, &moving->paint.blue);
    exchange_numbers(turned, &slot->paint.alpha, &moving->paint.alpha);
}

INLINE void insert(Nodes *nodes, Fragment fragment, const Paint *color)
{
    Slot moving;
    Whole depth = DEPTH_KEY(fragment);
    moving.depth = depth;
    moving.paint.red = STORED(color->alpha * color->red * FULL);
    moving.paint.green = STORED(color->alpha * color->green * FULL);
    moving.paint.blue = STORED(color->alpha * color->blue * FULL);
    moving.paint.alpha = STORED((1.0f - color->alpha) * FULL);
    UNROLL for (int i = 0; i < SLOTS; ++i) exchange_slots(depth, nodes->slot + i, &moving);
    Paint *last = &nodes->slot[SLOTS - 1].paint;
    Number through = as_number(last->alpha);
    last->red = STORED(last->red + through * moving.paint.red);
    last->green = STORED(last->green + through * moving.paint.green);
    last->blue = STORED(last->blue + through * moving.paint.blue);
    last->alpha = STORED(through * moving.paint.alpha);
}

INLINE void resolve_nodes(const Nodes *nodes, Paint *resolved)
{
    resolved->red = resolved->green = resolved->blue = (Number)(0.0f);
    resolved->alpha = (Number)(1.0f);
    UNROLL for (int i = 0; i < SLOTS; ++i) {
        const Paint *paint = &nodes->slot[i].paint;
        resolved->red += resolved->alpha * as_number(paint->red);
        resolved->green += resolved->alpha * as_number(paint->green);
        resolved->blue += resolved->alpha * as_number(paint->blue);
        resolved->alpha *= as_number(paint->alpha);
    }
}

#include "frames/inserting.h"
