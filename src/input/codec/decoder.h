/* Codecs in a process of their own.
 *
 * A decoder is one child process, for one thread: it gets a compressed stream in memory that both share, and answers
 * with pixels there or with a reason. When it dies, asks for too much memory, computes too long or makes a forbidden
 * system call, that frame is refused and the next one starts another child; one that is killed from outside gets a
 * second chance. It sees the pixels of one series and no
 * file, and can be taken over by a damaged stream without harm to the program.
 *
 * With two slots the next stream is handed over while the child decodes: it goes on at once when it has answered, and
 * need not wait until its caller has been woken.
 *
 * The child is a fork, for a library cannot know a program to run instead. Its caller may have any number of threads,
 * so the child must not wait for a lock that one of them held: the C library makes its own (malloc, stdio) whole again
 * after a fork; DCMTK's decoders are registered before it, and a fork waits until no thread of ours is inside DCMTK
 * (cts_dcm_fork()); the child uses nothing else that locks, and no threads. A child that hangs all the same is given
 * up. Volumes are hidden from it (cts_hide_from_children()), so that a fork copies no page tables of them.
 *
 * A child ends when its socket is closed, whatever way the program ends. It is waited for by its own number; where the
 * program waits for all children or ignores SIGCHLD, only the cause of a death gets lost. */
#ifndef CTS_DICOM_DECODER_H
#define CTS_DICOM_DECODER_H

#include "input/codec/codec.h"
#include <sys/types.h>

enum { CTS_DECODER_SLOTS = 2 };

/* One frame; places are offsets into the shared memory. */
typedef struct CtsDecoderJob {
    CtsFrameFormat format; /* syntax points to a constant, which a fork has at the same place */
    size_t stream, n, pixels;
} CtsDecoderJob;

typedef struct CtsDecoder {
    cts_decode_fn decode;
    const char *name; /* for messages: "decoder" */
    bool own_bytes;   /* what it reads comes from this program: no walls, and it may have threads */
    int n_slots;      /* frames at a time, 1 to CTS_DECODER_SLOTS */
    pid_t pid;        /* 0: no child now */
    bool with_htj2k;  /* the child has cts_htj2k_prepare() behind it */
    int socket;       /* to the child */
    void *shared;     /* slots, each of a stream, then pixels */
    size_t stream_capacity, pixel_capacity;
    CtsDecoderJob jobs[CTS_DECODER_SLOTS]; /* handed over and not taken yet, the oldest first */
    int n_jobs, next_slot;
    int cpu_limit_s;     /* for one frame; 0: as long as its size lets expect */
    int quiet_limit_s;   /* without any computing, a lock that nobody will open; 0: a minute */
    size_t memory_limit; /* what a child may take; 0: as much as the room's size lets expect */
} CtsDecoder;

/* A decoder without a child, for foreign bytes; decode is what the child will run. */
CtsDecoder cts_decoder_make(cts_decode_fn decode);

/* The same on the heap and with n_slots, where *decoder is NULL; and gone again. */
CtsStatus cts_decoder_new(CtsDecoder **decoder, cts_decode_fn decode, int n_slots, CtsError *err);
void cts_decoder_free(CtsDecoder **decoder);

/* Whether another frame has room beside those that have been handed over. */
bool cts_decoder_fits(const CtsDecoder *decoder, const CtsFrameFormat *format, size_t n);

/* Make room for a stream of n bytes and its pixels, starting a child when there is none or its room is too small. The
 * caller puts the bytes at *stream. While frames are under way only where the next fits. */
CtsStatus cts_decoder_room(CtsDecoder *decoder, const CtsFrameFormat *format, size_t n, uint8_t **stream,
                           CtsError *err);

/* Hand over the n bytes at stream, which lies inside the room. */
void cts_decoder_send(CtsDecoder *decoder, const CtsFrameFormat *format, const uint8_t *stream, size_t n);

/* Wait for the oldest frame that was handed over. *pixels lies in shared memory and is valid until the next is made
 * room for. CTS_ERR_PIXELS, with the reason, for everything that the stream can do to its decoder. */
CtsStatus cts_decoder_take(CtsDecoder *decoder, const void **pixels, CtsError *err);

/* Both, where none is under way. */
CtsStatus cts_decoder_run(CtsDecoder *decoder, const CtsFrameFormat *format, const uint8_t *stream, size_t n,
                          const void **pixels, CtsError *err);

/* End the child; what it has decoded stays, what is under way is dropped. */
void cts_decoder_end(CtsDecoder *decoder);

/* End the child and free the memory; the decoder may be used again. */
void cts_decoder_stop(CtsDecoder *decoder);

#endif
