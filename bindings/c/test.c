/* SPDX-FileCopyrightText: 2026 The CompMark authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The C interface from C: test CMK KEY DECODER CLAIM OUT. Opens a compressed model, draws it, writes it, reads its mark
 * in the model and in pictures in memory, and asks for what must be refused. Prints what failed; the status is the
 * number of failures.
 * test report KEY CMK: prints the report of a reading without options, or why there is none and exits with 2. `test
 * report-any KEY CMK`: the same with any_decoder. `test restored KEY MODEL UNMARKED`: that of compmark_verify_restored. */
#include "compmark.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;
static int checks = 0;
#define CHECK(condition)                                                   \
  do {                                                                     \
    ++checks;                                                              \
    if (!(condition)) {                                                    \
      ++failures;                                                          \
      printf("%s:%d: CHECK(%s) failed\n", __FILE__, __LINE__, #condition); \
    }                                                                      \
  } while (0)

static int says(const compmark_session* session, const char* word) {
  const char* error = compmark_last_error(session);
  if (strstr(error, word) != NULL && strchr(error, '\n') == NULL) return 1;
  printf("the error is: %s\n", error);
  return 0;
}

static int print_report(compmark_session* session, const char* key, const char* model, const char* unmarked,
                        int any_decoder) {
  compmark_reading reading;
  compmark_verdict verdict;
  char* report = NULL;
  compmark_reading_init(&reading);
  reading.key = key;
  reading.model = model;
  reading.unmarked = unmarked;
  reading.any_decoder = any_decoder;
  if ((unmarked != NULL ? compmark_verify_restored : compmark_verify)(session, &reading, &verdict, &report) != 0) {
    printf("%s\n", compmark_last_error(session));
    return 2;
  }
  printf("%s\n", report);
  compmark_text_free(report);
  return 0;
}

int main(int argc, char** argv) {
  compmark_session* session = compmark_session_new(2);
  compmark_model *model, *again;
  compmark_camera camera, broken;
  compmark_reading reading;
  compmark_verdict of_model, of_pictures;
  compmark_picture pictures[32];
  char* report = NULL;
  size_t count, cameras, i, k;
  float *rgb, *other;

  if (argc == 5 && session != NULL && strcmp(argv[1], "restored") == 0) {
    const int status = print_report(session, argv[2], argv[3], argv[4], 0);
    compmark_session_free(session);
    return status;
  }
  if (argc == 4 && session != NULL && strncmp(argv[1], "report", 6) == 0) {
    const int status = print_report(session, argv[2], argv[3], NULL, strcmp(argv[1], "report-any") == 0);
    compmark_session_free(session);
    return status;
  }
  if (argc != 6 || session == NULL) return 100;
  CHECK(compmark_abi() == COMPMARK_ABI);
  CHECK(strlen(compmark_version()) >= 5);
  CHECK(strcmp(compmark_last_error(session), "") == 0);

  model = compmark_model_open(session, argv[1]);
  if (model == NULL) {
    printf("%s\n", compmark_last_error(session));
    return 100;
  }
  CHECK(strncmp(compmark_model_recipe(model), "hac", 3) == 0);
  CHECK(compmark_model_anchors(model) > 0);
  cameras = compmark_model_cameras(model);
  CHECK(cameras > 0 && cameras <= 32);
  CHECK(compmark_model_camera(session, model, 0, &camera) == 0);
  CHECK(camera.width > 0 && camera.fx > 0);
  CHECK(compmark_model_camera(session, model, cameras, &camera) == -1 && says(session, "index"));

  count = (size_t)camera.width * (size_t)camera.height * 3;
  rgb = malloc(count * sizeof *rgb);
  other = malloc(count * sizeof *other);
  if (rgb == NULL || other == NULL) return 100;
  CHECK(compmark_render(session, model, &camera, rgb, count) == 0);
  for (i = 0, k = 0; i < count; ++i) k += rgb[i] > 0.02f && rgb[i] < 1.02f;
  CHECK(k > count / 100); /* something is drawn, and within its range */

  /* What is written, opened again, draws the same picture. */
  CHECK(compmark_model_write(session, model, argv[5]) == 0);
  again = compmark_model_open(session, argv[5]);
  CHECK(again != NULL);
  CHECK(compmark_render(session, again, &camera, other, count) == 0);
  CHECK(memcmp(rgb, other, count * sizeof *rgb) == 0);
  compmark_model_free(again);

  /* The mark, in the model and in its pictures. */
  compmark_reading_init(&reading);
  CHECK(reading.false_positive_rate == 1e-6 && reading.tests == 1);
  reading.key = argv[2];
  reading.decoder = argv[3];
  reading.model = argv[1];
  reading.all_cameras = 1;
  reading.false_positive_rate = 1e-3;
  CHECK(compmark_verify(session, &reading, &of_model, &report) == 0);
  CHECK(of_model.verdict == COMPMARK_DETECTED);
  CHECK(of_model.not_a_proof == 1); /* without a claim */
  CHECK(of_model.bits == 32 && of_model.matches >= 28 && of_model.p_value < 1e-5);
  CHECK(report != NULL && strstr(report, "\"schema\": \"compmark.verification.1\"") != NULL);
  compmark_text_free(report);
  reading.claim = argv[4];
  CHECK(compmark_verify(session, &reading, &of_model, NULL) == 0);
  CHECK(of_model.verdict == COMPMARK_DETECTED && of_model.not_a_proof == 0);

  /* Put back together in itself, nothing is left to read: the control of `test restored`. */
  CHECK(compmark_verify_restored(session, &reading, &of_pictures, NULL) == -1 && says(session, "unmarked: is missing"));
  reading.unmarked = argv[1];
  CHECK(compmark_verify_restored(session, &reading, &of_pictures, NULL) == 0);
  CHECK(of_pictures.verdict != COMPMARK_DETECTED);
  reading.unmarked = NULL;

  reading.model = NULL;
  reading.pictures = pictures;
  reading.picture_count = cameras;
  for (i = 0; i < cameras; ++i) {
    uint8_t* bytes = malloc(count);
    if (bytes == NULL) return 100;
    CHECK(compmark_model_camera(session, model, i, &camera) == 0);
    CHECK(compmark_render(session, model, &camera, rgb, count) == 0);
    for (k = 0; k < count; ++k) bytes[k] = (uint8_t)lrintf(255 * fminf(fmaxf(rgb[k], 0), 1));
    pictures[i].name = NULL;
    pictures[i].pixels = bytes;
    pictures[i].width = camera.width;
    pictures[i].height = camera.height;
    pictures[i].channels = 3;
  }
  CHECK(compmark_verify(session, &reading, &of_pictures, NULL) == 0);
  CHECK(of_pictures.matches == of_model.matches && of_pictures.p_value == of_model.p_value);
  /* The control: pictures without a mark. */
  for (i = 0; i < cameras; ++i) {
    uint8_t* bytes = (uint8_t*)pictures[i].pixels;
    for (k = 0; k < count; ++k) bytes[k] = (uint8_t)(40 + (k / 3 * 7 + i * 31) % 160);
  }
  CHECK(compmark_verify(session, &reading, &of_pictures, NULL) == 0);
  CHECK(of_pictures.verdict != COMPMARK_DETECTED);

  /* What is refused. */
  CHECK(compmark_model_open(session, "nowhere.cmk") == NULL && says(session, "nowhere.cmk"));
  CHECK(compmark_model_open(session, NULL) == NULL && says(session, "NULL"));
  CHECK(compmark_render(session, model, &camera, rgb, count - 1) == -1 && says(session, "count"));
  broken = camera;
  broken.fx = NAN;
  CHECK(compmark_render(session, model, &broken, rgb, count) == -1 && says(session, "fx"));
  broken = camera;
  broken.width = 1 << 30;
  CHECK(compmark_render(session, model, &broken, rgb, count) == -1 && says(session, "width"));
  broken = camera;
  broken.rotation_camera_world[0] += 1;
  CHECK(compmark_render(session, model, &broken, rgb, count) == -1 && says(session, "rotation"));
  broken = camera; /* orthonormal, but a mirror image */
  for (k = 0; k < 3; ++k) broken.rotation_camera_world[k] *= -1;
  CHECK(compmark_render(session, model, &broken, rgb, count) == -1 && says(session, "reflection"));
  for (k = 3; k < 6; ++k) broken.rotation_camera_world[k] *= -1; /* two axes turned: a rotation */
  CHECK(compmark_render(session, model, &broken, rgb, count) == 0);
  CHECK(compmark_render(session, NULL, &camera, rgb, count) == -1 && says(session, "NULL"));
  CHECK(compmark_render(NULL, model, &camera, rgb, count) == -1);
  CHECK(compmark_verify_restored(session, &reading, &of_pictures, NULL) == -1 && says(session, "model: is missing"));
  reading.key = NULL;
  CHECK(compmark_verify(session, &reading, &of_pictures, NULL) == -1 && says(session, "key"));
  reading.key = argv[2];
  pictures[0].channels = 7;
  CHECK(compmark_verify(session, &reading, &of_pictures, &report) == -1 && says(session, "channels"));
  CHECK(report == NULL);
  reading.picture_count = 0;
  CHECK(compmark_verify(session, &reading, &of_pictures, NULL) == -1 && says(session, "give a model or images"));
  reading.false_positive_rate = 2;
  CHECK(compmark_verify(session, &reading, &of_pictures, NULL) == -1);
  CHECK(compmark_model_write(session, model, "no-such-folder/model.safetensors") == -1);

  for (i = 0; i < cameras; ++i) free((void*)pictures[i].pixels);
  free(rgb);
  free(other);
  compmark_model_free(model);
  compmark_model_free(NULL);
  compmark_session_free(session);
  compmark_session_free(NULL);
  printf("%d checks, %d failed\n", checks, failures);
  return failures;
}
