/* The instructions of tapes, by number: those that move values, those of tapes (stc/codegen/tape.py), and sine and cosine
 * together. */
#ifndef STC_TAPES_H
#define STC_TAPES_H

#define INSTRUCTIONS(each) \
    each(uniform) each(literal) each(fetch) each(kept) each(store) \
    each(add) each(sub) each(mul) each(div) each(pow) each(neg) each(sqrt) \
    each(sin) each(cos) each(tan) each(asin) each(acos) each(atan) each(atan2) \
    each(sinh) each(cosh) each(tanh) each(exp) each(log) \
    each(clip) each(reaches) each(read) \
    each(sincos)

#define NUMBERED(name) name##_,
enum { INSTRUCTIONS(NUMBERED) };

#endif
