// adaptive: a curve of NODES steps says how much of each fragment is seen; not exact where there are more fragments.
//
// Salvi, Montgomery and Lefohn (2011, "Adaptive Transparency") write blending as a sum, which needs no order:
//   C = sum(Ci Ai vis(zi)),   vis(z) = product of (1 - Aj) over all zj < z
// vis falls by a step at each fragment. A first walk over the fragments builds it of NODES steps at most, a second one adds
// up the colours. Where a step is too many, one is moved to the step in front of it, so that the curve lies below the true
// one. It is the step whose move takes the least area from below the curve:
//   (zi - zi-1) (Ti-1 - Ti),   Ti being what comes through behind node i, and z the distance
// The first node stays, as there is none in front of it, and so does the last, as in the authors' program. So the foremost
// fragment is seen in full, the coverage is exact, and no channel is ever too bright.
//
// Which steps are moved depends on the order in which they come: that of submission, so that nothing has to be sorted.
// Of equal depths the fragment that was submitted first is in front.
//
//   parameters    the scale of depths (fragments/depth.h)
#ifndef NODES
#define NODES 8
#endif
#ifndef PERSPECTIVE
#define PERSPECTIVE 1
#endif
#define PARAMETERS 1
#define TWO_WALKS 1
#include "frames/inserted.h"
#include "fragments/depth.h"

typedef struct {
    Fragment place;  // of the fragment whose step it is; ABSENT if there is none
    Number distance;
    Number through;  // what comes through behind it, as a buffer keeps it; behind the last one this stays the same
} Node;
typedef struct {
    Node node[NODES + 1];  // the last one is there only while a fragment is inserted
    Paint sums;
} Nodes;

INLINE void clear_nodes(Nodes *nodes)
{
    UNROLL for (int i = 0; i <= NODES; ++i) {
        Node *node = nodes->node + i;
        node->place = (Fragment)(ABSENT), node->distance = (Number)(0.0f), node->through = (Number)(FULL);
    }
    nodes->sums.red = nodes->sums.green = nodes->sums.blue = nodes->sums.alpha = (Number)(0.0f);
}

// The distance of a fragment: in units of the near plane's, or in parallel projection of the range and from its far end.
INLINE Number distance_of(Fragment fragment, float scale)
{
#if LANES == 1
    Number depth = depth_of(DEPTH_KEY(fragment), scale);
#else
    Number depth = depth_of((VECTOR(uint))(DEPTH_KEY(fragment)), scale).s0;
#endif
    return PERSPECTIVE ? 1.0f / depth : -depth;
}

// Takes one of NODES + 1 nodes away: the last one where it is empty, else the one that is missed least.
INLINE void compress(Node *all)
{
    Number least = (all[1].distance - all[0].distance) * (all[0].through - all[1].through);
    Whole away = (Whole)(1);
    UNROLL for (int i = 2; i < NODES; ++i) {
        Number area = (all[i].distance - all[i - 1].distance) * (all[i - 1].through - all[i].through);
        Truth less = area < least;
        least = less ? area : least, away = less ? (Whole)(i) : away;
    }
    away = IS_BEFORE(all[NODES].place, (Fragment)(ABSENT)) ? away : (Whole)(NODES);
    UNROLL for (int i = 0; i < NODES; ++i) {
        Truth moved = away <= (Whole)(i + 1);
        all[i].through = choose(moved, all[i + 1].through, all[i].through);
        Truth gone = away <= (Whole)(i);
        all[i].distance = choose(gone, all[i + 1].distance, all[i].distance);
        all[i].place = choose_fragment(gone, all[i + 1].place, all[i].place);
    }
}

// Puts a node in place of one that is behind the fragment.
INLINE void put_before(Node *other, Fragment fragment, const Node *node)
{
    Truth behind = IS_BEFORE(fragment, other->place);
    other->distance = choose(behind, node->distance, other->distance);
    other->through = choose(behind, node->through, other->through);
    other->place = choose_fragment(behind, node->place, other->place);
}

INLINE void insert(Nodes *nodes, Fragment fragment, const Paint *color, global const float *parameters)
{
    Number through = 1.0f - color->alpha, distance = distance_of(fragment, parameters[0]);
    Node *all = nodes->node;
    all[NODES].place = (Fragment)(ABSENT), all[NODES].through = all[NODES - 1].through;
    // A node behind the new one moves one place back, and the step is added to it. What comes through a node then is what
    // has come through the one before its new place, and through the fragment: so it is for the new node.
    UNROLL for (int i = NODES; i > 0; --i) {
        Truth moved = IS_BEFORE(fragment, all[i - 1].place);
        Node node = {choose_fragment(moved, all[i - 1].place, fragment), choose(moved, all[i - 1].distance, distance),
                     STORED(all[i - 1].through * through)};
        put_before(all + i, fragment, &node);
    }
    Node node = {fragment, distance, STORED(FULL * through)};
    put_before(all, fragment, &node);
    compress(all);
}

// Adds a fragment's colour, as much of it as is seen at its place.
INLINE void gather_color(Nodes *nodes, Fragment fragment, const Paint *color)
{
    Number seen = (Number)(FULL);
    UNROLL for (int i = 0; i < NODES; ++i)
        seen = choose(IS_BEFORE(nodes->node[i].place, fragment), nodes->node[i].through, seen);
    Paint *sums = &nodes->sums;
    sums->red = STORED(sums->red + seen * (color->alpha * color->red));
    sums->green = STORED(sums->green + seen * (color->alpha * color->green));
    sums->blue = STORED(sums->blue + seen * (color->alpha * color->blue));
}

INLINE void resolve_nodes(const Nodes *nodes, Paint *resolved)
{
    resolved->red = as_number(nodes->sums.red), resolved->green = as_number(nodes->sums.green);
    resolved->blue = as_number(nodes->sums.blue), resolved->alpha = as_number(nodes->node[NODES - 1].through);
}

#include "frames/inserting.h"
