/* SPDX-FileCopyrightText: 2026 The CompMark authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * CompMark for other languages: open a model, render it, decode a compressed one, and prove whose it is. C99; the
 * library is libcompmark (bindings/c/compmark.cpp), and no C++ type or exception crosses it.
 *
 *   compmark_session *session = compmark_session_new(0);
 *   compmark_model *model = compmark_model_open(session, "scene.cmk");
 *   if (model == NULL) puts(compmark_last_error(session));
 *
 * Functions that can fail return 0 for success and -1 for an error, or NULL where they return a pointer; the reason is
 * compmark_last_error(session), one line that names the file, the field and the remedy. Paths and texts are UTF-8 and
 * end with a zero. A session and its models serve one thread at a time; different sessions do not know of each other.
 * NULL is an error where a pointer is needed, never a crash; the functions that free take it.
 */
#ifndef COMPMARK_H
#define COMPMARK_H

#include <stddef.h>
#include <stdint.h>

#if defined(__cplusplus)
extern "C" {
#endif

#if defined(__GNUC__)
#define COMPMARK_API __attribute__((visibility("default")))
#else
#define COMPMARK_API
#endif

/* Changes when a function or a struct of this header does so that a program has to be compiled again. */
#define COMPMARK_ABI 1

/* Threads, and the last error. */
typedef struct compmark_session compmark_session;
/* A trained model, a compressed one or a splat file. */
typedef struct compmark_model compmark_model;

/* A pinhole camera in the model's coordinates: x right, y down, z ahead; pixels, the middle of the first at (0.5, 0.5);
 * point_camera = rotation (point_world - center). */
typedef struct compmark_camera {
  int32_t width, height;
  double fx, fy, cx, cy;
  double rotation_camera_world[9]; /* orthonormal rows, determinant 1 */
  double center_world[3];
} compmark_camera;

/* A picture in memory: rows of 8-bit values [height, width, channels]; channels are 1 grey, 2 grey and alpha, 3 RGB or
 * 4 RGBA. */
typedef struct compmark_picture {
  const char* name; /* for the report; may be NULL */
  const uint8_t* pixels;
  int32_t width, height, channels;
} compmark_picture;

/* What is read, and with what. compmark_reading_init fills it with what `compmark verify` does without options; then
 * set key, and model or images or pictures. Paths that are NULL are not given. As there, it is an error if the record
 * beside the key (KEY.record) or the model (mark.json) says that another decoder reads this mark; lines of a record
 * that are damaged are ignored. */
typedef struct compmark_reading {
  const char* key;     /* the owner's key file */
  const char* decoder; /* NULL: decoder.safetensors beside the model, or else the one that comes with the library */
  const char *claim, *time_stamp;
  const char* model;         /* a model, or */
  const char* unmarked;      /* of a model: what it says by itself is subtracted */
  const char* interference;  /* the same from a file */
  const char* const* images; /* files and folders, and */
  size_t image_count;
  const compmark_picture* pictures; /* pictures in memory */
  size_t picture_count;
  double false_positive_rate; /* that you accept; choose it before you look */
  uint64_t tests;             /* in all: keys times crops times models */
  size_t views;               /* at most so many cameras or files, evenly spaced; 0: all */
  int32_t all_cameras;        /* of a model; 0: its test cameras, or those of its training where there are none */
  int32_t mirrored;           /* the pictures may have been mirrored, which counts as two tests */
  float background[3];        /* behind transparent pixels, 0 to 1 */
  int32_t any_decoder;        /* take this decoder even if a record names another one */
} compmark_reading;

enum { COMPMARK_DETECTED = 0, COMPMARK_NOT_DETECTED = 1, COMPMARK_INCONCLUSIVE = 3 };

typedef struct compmark_verdict {
  int32_t verdict;
  int32_t not_a_proof; /* detected, but somebody could have made it so: the report's "proof" has the reason */
  uint64_t bits, matches;
  double p_value, p_corrected;
} compmark_verdict;

COMPMARK_API int compmark_abi(void);             /* COMPMARK_ABI of the library */
COMPMARK_API const char* compmark_version(void); /* "0.1.0" */

/* threads = 0: as many as this process may use; at most 1024. NULL: there is no memory for it. */
COMPMARK_API compmark_session* compmark_session_new(uint32_t threads);
COMPMARK_API void compmark_session_free(compmark_session* session);
/* Of the last call with this session that failed; "" before the first. Valid until the next call with it. */
COMPMARK_API const char* compmark_last_error(const compmark_session* session);

/* model.safetensors of a run, a .cmk, or a splat file. */
COMPMARK_API compmark_model* compmark_model_open(compmark_session* session, const char* path);
COMPMARK_API void compmark_model_free(compmark_model* model);
COMPMARK_API const char* compmark_model_recipe(const compmark_model* model); /* "" for NULL; valid as long as it is */
COMPMARK_API size_t compmark_model_anchors(const compmark_model* model);
COMPMARK_API size_t compmark_model_cameras(const compmark_model* model); /* that are stored in it */
COMPMARK_API int compmark_model_camera(compmark_session* session, const compmark_model* model, size_t index,
                                       compmark_camera* camera);
/* RGB rows [height, width, 3] in [0, 1], but for rounding. `count` is the number of floats there is room for. */
COMPMARK_API int compmark_render(compmark_session* session, compmark_model* model, const compmark_camera* camera,
                                 float* rgb, size_t count);
/* The model as model.safetensors, replaced whole or not at all: what a .cmk is decoded to. */
COMPMARK_API int compmark_model_write(compmark_session* session, const compmark_model* model, const char* path);

COMPMARK_API void compmark_reading_init(compmark_reading* reading);
/* `report`, if not NULL, becomes the report of `compmark verify --json`, to be freed by compmark_text_free. */
COMPMARK_API int compmark_verify(compmark_session* session, const compmark_reading* reading, compmark_verdict* verdict,
                                 char** report);
/* The same of a model that somebody tore: the features that are left of reading->model are read in reading->unmarked,
 * anchor by anchor, as `compmark verify --restored` does. An error without either, or where no anchor is one of the
 * unmarked model's. The report has "restored": how many anchors there are, how many were found, and how often what they
 * carry was raised. */
COMPMARK_API int compmark_verify_restored(compmark_session* session, const compmark_reading* reading,
                                          compmark_verdict* verdict, char** report);
COMPMARK_API void compmark_text_free(char* text);

#if defined(__cplusplus)
}
#endif

#endif
