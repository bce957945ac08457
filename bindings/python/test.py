# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""The module as a user has it: test.py SOURCE."""

import json
import os
import shutil
import sys
import tempfile
import threading
import unittest

import numpy

import compmark

MARKED = os.path.join(sys.argv[1], "tests/golden/marked")
DECODER = os.path.join(sys.argv[1], "weights/lattice_32.safetensors")
KEY = os.path.join(MARKED, "owner.key")


class Binding(unittest.TestCase):
    def setUp(self):
        self.model = compmark.Model(os.path.join(MARKED, "hac.cmk"))

    def read(self, **more):
        return compmark.verify(KEY, decoder=DECODER, false_positive_rate=1e-3, **more)

    def test_a_model_is_drawn_and_written(self):
        self.assertEqual(self.model.recipe.split("+")[0], "hac")
        self.assertGreater(self.model.anchors, 0)
        camera = self.model.cameras[0]
        picture = self.model.render(camera)
        self.assertEqual(picture.shape, (camera.height, camera.width, 3))
        self.assertGreater(picture.std(), 0.01)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "model.safetensors")
            self.model.write(path)
            self.assertTrue(numpy.array_equal(picture, compmark.Model(path).render(camera)))
        camera.rotation_camera_world = numpy.diag([1.0, 1.0, 2.0])
        with self.assertRaisesRegex(compmark.Error, "rotation"):
            self.model.render(camera)

    def test_the_mark_is_read_from_the_model_and_from_arrays(self):
        of_model = self.read(model=os.path.join(MARKED, "hac.cmk"), all_cameras=True)
        self.assertEqual(of_model.verdict, "detected")
        self.assertTrue(of_model.not_a_proof)  # without a claim
        self.assertFalse(of_model.detected)
        self.assertGreaterEqual(of_model.matches, 28)
        self.assertEqual(of_model.report["schema"], "compmark.verification.1")
        pictures = [self.model.render(camera) for camera in self.model.cameras]
        of_arrays = self.read(pictures=pictures)
        self.assertEqual((of_arrays.matches, of_arrays.p_value), (of_model.matches, of_model.p_value))
        self.assertEqual(len(of_arrays.report["views"]), len(pictures))
        grey = [numpy.full((64, 64), 0.5) + 0.1 * numpy.sin(numpy.arange(64) / 3)]
        self.assertNotEqual(self.read(pictures=grey).verdict, "detected")

    def test_the_decoder_beside_the_model_is_taken_first(self):
        with tempfile.TemporaryDirectory() as folder:
            model = shutil.copy(os.path.join(MARKED, "hac.cmk"), folder)
            # The control: without it the shipped decoder reads, which finds no mark of another.
            self.assertLess(compmark.verify(KEY, model=model).matches, 20)
            shutil.copy(DECODER, os.path.join(folder, "decoder.safetensors"))
            of_model = compmark.verify(KEY, model=model)
            self.assertEqual((of_model.bits, of_model.matches), (32, 28))
            # The record of a key that names another decoder.
            key = shutil.copy(KEY, folder)
            with open(key) as text:
                commitment = json.load(text)["commitment"]
            with open(key + ".record", "w") as record:
                json.dump({"schema": "compmark.mark.1", "key": {"id": "", "commitment": commitment},
                           "decoder": {"file": "", "sha256": "", "tensors_sha256": "0"}, "models": []}, record)
            with self.assertRaisesRegex(compmark.Error, "is not the decoder of this key's mark"):
                compmark.verify(key, model=model)
            self.assertEqual(compmark.verify(key, model=model, any_decoder=True).matches, 28)

    def test_a_model_is_put_back_together_in_the_unmarked_one(self):
        model = os.path.join(MARKED, "hac.cmk")
        itself = self.read(model=model, unmarked=model, restored=True)
        anchors = self.model.anchors
        self.assertEqual(itself.report["restored"], {"anchors": anchors, "found": anchors, "raised": 1})
        # The control: less itself nothing is left to read, of which the model as it is has a mark.
        self.assertNotEqual(itself.verdict, "detected")
        self.assertNotIn("restored", self.read(model=model).report)
        with self.assertRaisesRegex(compmark.Error, "unmarked: is missing"):
            self.read(model=model, restored=True)
        with self.assertRaisesRegex(compmark.Error, "model: is missing"):
            self.read(images=["photo.png"], unmarked=model, restored=True)

    def test_one_file_and_one_array_are_not_taken_apart(self):
        picture = self.model.render(self.model.cameras[0])
        self.assertEqual(len(self.read(pictures=picture).report["views"]), 1)
        with self.assertRaisesRegex(compmark.Error, "photo.png"):
            self.read(images="photo.png")

    def test_threads_of_python_have_their_own_errors(self):
        session, said = compmark.Session(1), {}

        def wrong(name):
            for _ in range(50):
                try:
                    compmark.Model(name, session)
                except compmark.Error as error:
                    said.setdefault(name, set()).add(name in str(error))

        threads = [threading.Thread(target=wrong, args=(f"nowhere{i}.cmk",)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(said, {f"nowhere{i}.cmk": {True} for i in range(4)})

    def test_what_is_wrong_is_said(self):
        with self.assertRaisesRegex(compmark.Error, "nowhere.cmk"):
            compmark.Model("nowhere.cmk")
        with self.assertRaisesRegex(compmark.Error, "nowhere.png"):
            self.read(images=["nowhere.png"])
        with self.assertRaisesRegex(compmark.Error, "give a model or images"):
            self.read()
        with self.assertRaisesRegex(compmark.Error, "both given"):
            self.read(model=os.path.join(MARKED, "hac.cmk"), images=["photo.png"])
        with self.assertRaisesRegex(ValueError, "value 0"):
            compmark.Model(os.path.join(MARKED, "hac.cmk") + "\0.ply")
        with self.assertRaisesRegex(ValueError, "views"):
            self.read(images=["photo.png"], views=-1)
        with self.assertRaisesRegex(ValueError, "tests"):
            self.read(images=["photo.png"], tests=-1)
        with self.assertRaisesRegex(ValueError, "0 to 1024"):
            compmark.Session(-1)
        with self.assertRaisesRegex(ValueError, "not a number"):
            self.read(pictures=[numpy.full((64, 64, 3), numpy.nan)])
        with self.assertRaisesRegex(ValueError, "uint8"):
            self.read(pictures=[numpy.zeros((64, 64, 3), dtype=numpy.int64)])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
