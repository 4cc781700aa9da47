// Inserting: the frame of techniques that keep a few nodes of a pixel, into which its fragments are inserted in the order
// of submission.
//
// A lane that works alone inserts a strip at a time. Several lanes have only registers to keep nodes in, so they insert
// pixel by pixel: the nodes of one pixel take a quarter of the registers that those of a lane's four pixels would.
//
// Before it includes this file, the technique includes frames/inserted.h and defines
//   Nodes                                  what is kept of a pixel, or of a strip
//   clear_nodes(nodes)                     as it is before the first fragment
//   insert(nodes, fragment, color)         inserts one; an ABSENT one has alpha 0 and must change nothing
//   resolve_nodes(nodes, resolved)         blends what is kept into premultiplied colour and transmittance
// With PARAMETERS, insert gets the kernel's own numbers too. With TWO_WALKS a second walk over the fragments follows, for
//   gather_color(nodes, fragment, color)
#ifndef INSERTING_H
#define INSERTING_H

#ifndef TWO_WALKS
#define TWO_WALKS 0
#endif
#if PARAMETERS
#define INSERT(nodes, fragment, color) insert(nodes, fragment, color, parameters)
#else
#define INSERT(nodes, fragment, color) insert(nodes, fragment, color)
#endif

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved
#if PARAMETERS
                          , global const float *parameters
#endif
                          )
{
#if LANES == 1
    Nodes nodes;
    clear_nodes(&nodes);
    uint deepest = largest(count);
    for (int walk = 0; walk <= TWO_WALKS; ++walk)
        for (uint first = 0; first < deepest; first += ROWS) {
            VECTOR(ulong) rows[ROWS];
            Colors source[ROWS];
            load_rows(fragments, begin, step, count, first, rows);
            uint fetched = MIN(deepest - first, (uint)ROWS);
            fetch_colors(rows, fetched, colors, source);
            for (uint k = 0; k < fetched; ++k) {
#if TWO_WALKS
                if (walk == 1) {
                    gather_color(&nodes, rows[k], source + k);
                    continue;
                }
#endif
                INSERT(&nodes, rows[k], source + k);
            }
        }
    resolve_nodes(&nodes, resolved);
#else
    PLAIN_LOOP for (int k = 0; k < STRIP; ++k) {
        global const ulong *list = fragments + ELEMENT(uint, begin, k);
        uint size = ELEMENT(uint, count, k);
        Nodes nodes;
        clear_nodes(&nodes);
        PLAIN_LOOP for (uint i = 0; i < size; ++i) {
            ulong fragment = list[(size_t)i * step];
            Paint color = paint_of(fragment_color(colors, (uint)fragment));
            INSERT(&nodes, fragment, &color);
        }
#if TWO_WALKS
        PLAIN_LOOP for (uint i = 0; i < size; ++i) {
            ulong fragment = list[(size_t)i * step];
            Paint color = paint_of(fragment_color(colors, (uint)fragment));
            gather_color(&nodes, fragment, &color);
        }
#endif
        Paint found;
        resolve_nodes(&nodes, &found);
        SET_ELEMENT(float, resolved->red, k, found.red), SET_ELEMENT(float, resolved->green, k, found.green);
        SET_ELEMENT(float, resolved->blue, k, found.blue), SET_ELEMENT(float, resolved->alpha, k, found.alpha);
    }
#endif
}

#include "frames/one_pass.h"

#endif
