// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// keygen, extract, verify and calibrate as an owner meets them: a key, a marked image, the right key and a wrong one, the four exit codes, and for every
// bad input one line, exit code 2, and nothing overwritten.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/files.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_claim.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/carrier_decoder.hpp>
#include <compmark/watermark/decoder/decoder_file.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <compmark/watermark/pretrain/pixel_embedding.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/shipped_decoders.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "support/picture.hpp"
#include "tool/running.hpp"

namespace verify_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-verify-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

constexpr int side = 96;

/// A lattice that nobody trained, of 48 bits, whose periods are short against the picture below.
LatticeDecoder<float> lattice(int bits = 48) { return testing::untrained_lattice(bits, 96, 14); }

std::vector<float> picture(std::uint64_t seed) { return testing::textured_picture(side, seed); }
ImageView<const float> view_of(const std::vector<float>& pixels) { return {pixels.data(), 3, side, side}; }

/// Writes picture number `seed` with a message in its pixels, at 34 dB.
void embed(const LatticeDecoder<float>& network, const Message& message, std::uint64_t seed, const std::string& path) {
  std::vector<float> signs;
  for (std::size_t i = 0; i < message.size(); ++i) signs.push_back(message[i] ? 1.0f : -1.0f);
  PixelEmbedding<LatticeDecoder<float>> embedding;
  PixelEmbeddingSettings settings;
  settings.steps = 60;
  settings.psnr = 34;
  settings.temperature = 20;
  settings.augmentation = no_augmentation();
  const std::vector<float> image = picture(seed);
  std::vector<float> result(image.size());
  ThreadExecutor executor(2);
  embedding.embed(
      network, view_of(image), std::span<const float>(signs), settings, seed, [](auto&&...) {},
      ImageView<float>{result.data(), 3, side, side}, executor);
  REQUIRE(write_png(path, view_of(result)).ok());
}

/// Files that all tests read, written once: a key, a decoder, three marked images and three unmarked ones.
struct Setting {
  std::string key = at("owner.key"), other = at("other.key"), decoder = at("lattice.safetensors");
  std::string marked = at("marked"), plain = at("plain"), claim;
  Setting() {
    // Fixed keys: whether a decoder that nobody whitened can carry a message depends on the message.
    for (const auto& [path, number] : {std::pair(&key, 1), std::pair(&other, 2)}) {
      Digest256 secret{};
      secret[0] = static_cast<std::byte>(number);
      const Result<OwnerKey> made = make_key(secret, "2026-01-01T00:00:00Z", 48);
      REQUIRE(made.ok());
      REQUIRE(write_key(*path, *made).ok());
    }
    const LatticeDecoder<float> network = lattice();
    REQUIRE(write_lattice<SafetensorsWriter>(network, "a test", fs::path(decoder)).ok());
    fs::create_directories(marked);
    fs::create_directories(plain);
    for (std::uint64_t i = 0; i < 3; ++i) {
      const std::string name = "/image" + std::to_string(i);
      embed(network, message_of(*read_key(key)), i, marked + name + ".png");
      const std::vector<float> image = picture(i);
      REQUIRE(write_file(plain + name + ".jpg", encode_jpeg(to_bytes(view_of(image)), 95)).ok());
    }
    REQUIRE(write_file(marked + "/notes.txt", std::string_view("no image")).ok());
    claim = testing::claimed(key, decoder);
  }
  [[nodiscard]] std::string with(const std::string& images) const {
    return " --key " + key + " --decoder " + decoder + " --images " + images + claim;
  }
};
const Setting& setting() {
  static const Setting instance;
  return instance;
}

/// No mark was found. Exit status 3 is what "inconclusive" has, where chance matches 33 to 40 of 48 bits (7 in 1000); a
/// mark that is found and not a proof has it too, and fails here.
void check_no_mark(const Outcome& outcome) {
  INFO(outcome.text);
  CHECK((outcome.code == 1 || outcome.code == 3));
  CHECK(outcome.text.find("\nDETECTED") == std::string::npos);
  CHECK(outcome.text.find("NOT A PROOF") == std::string::npos);
}

}  // namespace

TEST_CASE("tool: verify detects the key that marked, and no other, nor anything in unmarked images") {
  const Setting& s = setting();
  const Outcome right = tool("verify" + s.with(s.marked) + " --json " + at("right.json"));
  INFO(right.text);
  CHECK(right.code == 0);
  CHECK(right.text.find("\nDETECTED, conditionally: ") != std::string::npos);
  CHECK(right.text.find("if the decoder was made without this key's message") != std::string::npos);
  const nlohmann::json json = json_of(at("right.json"));
  CHECK(json["verdict"] == "detected");
  CHECK(json["matches"].get<std::size_t>() >= 46);
  CHECK(json["p_value"].get<double>() == binomial_tail(json["matches"].get<std::size_t>(), 48));
  CHECK(json["views"].size() == 3);
  CHECK(json["views"][0]["name"] == "image0.png");
  CHECK(json["views"][0]["sha256"].get<std::string>().size() == 64);
  CHECK(json["views"][0]["sha256"] != json["views"][1]["sha256"]);
  CHECK(json["key"]["commitment"] == read_key(s.key)->commitment());
  CHECK(json["decoder"]["sha256"].get<std::string>().size() == 64);
  CHECK(json["model"]["sha256"].is_null());
  // The secret is nowhere, neither in the report nor on the screen.
  const std::string secret = json_of(s.key)["secret"];
  CHECK(json.dump().find(secret.substr(0, 16)) == std::string::npos);
  CHECK(right.text.find(secret.substr(0, 16)) == std::string::npos);
  // Who has report and key repeats the verdict.
  std::vector<ViewLogits> views;
  for (const auto& view : json["views"]) views.push_back({view["name"], "", view["logits"].get<std::vector<double>>()});
  const Result<Verification> again = verify_message(message_of(*read_key(s.key)), views);
  REQUIRE(again.ok());
  CHECK(again->evidence.p_value == json["p_value"].get<double>());

  const std::string rest = " --decoder " + s.decoder + " --images ";
  for (const std::string& arguments : {" --key " + s.other + rest + s.marked, " --key " + s.key + rest + s.plain}) {
    check_no_mark(tool("verify" + arguments));
  }
  // The control: what is found without a claim says so, and would not pass for "no mark".
  const Outcome unclaimed = tool("verify --key " + s.key + rest + s.marked);
  CHECK(unclaimed.code == 3);
  CHECK(unclaimed.text.find("NOT A PROOF") != std::string::npos);
  const Outcome single = tool("verify" + s.with(s.marked + "/image1.png " + s.marked + "/image2.png") + " --threads 1");
  CHECK(single.code == 0);
  CHECK(single.text.find("from 2 views") != std::string::npos);
  // Both ways: two tests, so 2 p; a decoder of means of colours reads a mirrored picture as it reads the picture.
  CHECK(json.count("mirrored") == 0);
  const Outcome both = tool("verify" + s.with(s.marked) + " --mirrored --json " + at("both.json"));
  CHECK(both.code == 0);
  CHECK(both.text.find("which is two tests") != std::string::npos);
  CHECK(json_of(at("both.json"))["mirrored"] == false);
  CHECK(json_of(at("both.json"))["p_corrected"].get<double>() == 2 * json["p_value"].get<double>());
}

TEST_CASE("tool: the record of a message has it as a soft binding, and every picture that was read") {
  const Setting& s = setting();
  const Outcome made = tool("certify" + s.with(s.marked) + " --views 2 --out " + at("record"));
  INFO(made.text);
  REQUIRE(made.code == 0);
  const nlohmann::json record = json_of(at("record/record.json")),
                       binding = nlohmann::json::from_cbor(testing::file_bytes(at("record/soft_binding.cbor")));
  CHECK(binding["blocks"][0]["value"] == record["read"]["hex"]);
  CHECK(binding["alg"] == "org.compmark.lattice.48");
  CHECK(fs::exists(at("record/images/0001_image0.png")));
  CHECK(fs::exists(at("record/images/0002_image1.png")));
  CHECK_FALSE(fs::exists(at("record/images/0003_image2.png")));
  CHECK(testing::text_of(at("record/record.html")).find("Is the message there?") != std::string::npos);
  // The images of the record say the same.
  REQUIRE(tool("verify" + s.with(at("record/images")) + " --json " + at("repeated.json")).code == 0);
  CHECK(json_of(at("repeated.json"))["read"] == record["read"]);
}

TEST_CASE("tool: verify is inconclusive where the chosen rate cannot be reached, and says why") {
  const Setting& s = setting();
  const Outcome strict = tool("verify" + s.with(s.marked) + " --tests 1000000000000");
  INFO(strict.text);
  CHECK(strict.code == 3);
  CHECK(strict.text.find("Use a longer message") != std::string::npos);
  CHECK(strict.text.find("for 1000000000000 tests") != std::string::npos);
}

TEST_CASE("tool: extract reads the same bits, and says that they prove nothing") {
  const Setting& s = setting();
  const std::string rest = " --decoder " + s.decoder + " --images " + s.marked;
  const Outcome outcome = tool("extract" + rest + " --json " + at("bits.json"));
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  const nlohmann::json json = json_of(at("bits.json"));
  const Result<Message> read = Message::from_hex(json["hex"].get<std::string>(), 48);
  REQUIRE(read.ok());
  CHECK(read->matches(message_of(*read_key(s.key))) >= 46);
  CHECK(json["key"]["id"].is_null());
  CHECK(json["views"][2]["logits"].size() == 48);
  CHECK(outcome.text.find(json["views"][2]["hex"].get<std::string>()) != std::string::npos);
  CHECK(outcome.text.find("marked or not") != std::string::npos);
  for (const char* threads : {"1", "3"}) {
    REQUIRE(tool("extract" + rest + " --threads " + threads + " --json " + at("again.json")).code == 0);
    CHECK(json_of(at("again.json")) == json);
  }
  REQUIRE(tool("extract" + rest + " --views 2 --json " + at("again.json")).code == 0);
  CHECK(json_of(at("again.json"))["views"].size() == 2);
}

TEST_CASE("tool: calibrate measures false positives of keys that are derived as keygen's are") {
  const Setting& s = setting();
  const Outcome outcome =
      tool("calibrate --decoder " + s.decoder + " --images " + s.plain + " --json " + at("null.json"));
  INFO(outcome.text);
  CHECK(outcome.code == 0);  // seed 1; one in thirty would say 3
  const nlohmann::json json = json_of(at("null.json"));
  CHECK(json["keys"] == 10000);
  CHECK(json["images"] == 3);
  CHECK(json["one_image"][0]["hits"].get<int>() > 20);
  CHECK(json["all_images"][1]["holds"] == true);
  CHECK(json["views"].size() == 3);
}

TEST_CASE("tool: a model's renders are read from its own cameras") {
  const Setting& s = setting();
  REQUIRE(tool("scene --out " + at("scene") + " --width 48 --height 40 --train 6 --test 2").code == 0);
  REQUIRE(tool("train --effects none --iterations 20 --data " + at("scene") + " --out " + at("run")).code == 0);
  const std::string arguments =
      "verify --key " + s.key + " --decoder " + s.decoder + " --model " + at("run/model.safetensors");
  const Outcome outcome = tool(arguments + " --json " + at("model.json"));
  check_no_mark(outcome);
  const nlohmann::json json = json_of(at("model.json"));
  CHECK(json["verdict"] != "detected");
  CHECK(json["views"].size() == 2);
  CHECK(json["model"]["sha256"] == json_of(at("run/results.json"))["model_sha256"]);
  // The renders that the tool writes are the ones it reads.
  REQUIRE(tool("render --model " + at("run/model.safetensors") + " --out " + at("renders")).code == 0);
  REQUIRE(tool("verify" + s.with(at("renders")) + " --json " + at("renders.json")).code == outcome.code);
  CHECK(json_of(at("renders.json"))["views"][0]["logits"] == json["views"][0]["logits"]);
  check_refused(tool(arguments + " --mirrored"), {"model.safetensors", "--mirrored"});
  // A model from which anchors may have been taken: four tests.
  const Outcome pruned = tool(arguments + " --pruned --json " + at("pruned.json"));
  check_no_mark(pruned);
  CHECK(pruned.text.find("it was read in four ways, which is four tests") != std::string::npos);
  const nlohmann::json ways = json_of(at("pruned.json"));
  CHECK(ways["test"]["tests_counted"] == 4);
  CHECK(outcome.text.find("try         --pruned") != std::string::npos);
  CHECK(pruned.text.find("try         --unmarked MODEL --restored") != std::string::npos);
  CHECK(ways["matches"] >= json["matches"]);
  CHECK(ways["missing_share"].get<double>() <= 0.5);
  CHECK(json.count("missing_share") == 0);
  check_refused(tool("verify" + s.with(at("renders")) + " --pruned"), {"--pruned", "images"});
  const Outcome restored = tool(arguments + " --restored --unmarked " + at("run/model.safetensors"));
  check_no_mark(restored);
  CHECK(restored.text.find(" anchors of the unmarked model are in the model\n") != std::string::npos);
  CHECK(restored.text.find("try         ") == std::string::npos);
  check_refused(tool(arguments + " --restored"), {"--restored", "--unmarked"});
  check_refused(tool("verify" + s.with(at("renders")) + " --restored --unmarked " + at("run/model.safetensors")),
                {"--restored", "images"});
  check_refused(tool(arguments + " --restored --pruned --unmarked " + at("run/model.safetensors")), {"--pruned"});
  REQUIRE(tool(arguments + " --split train --views 4 --json " + at("train.json")).code != 2);
  CHECK(json_of(at("train.json"))["views"].size() == 4);
  // What the scene says by itself, measured from the unmarked model once, is subtracted.
  const std::string measure = "interference --views 30 --decoder " + s.decoder + " --model ";
  const Outcome measured = tool(measure + at("run/model.safetensors") + " --out " + at("interference.safetensors"));
  INFO(measured.text);
  REQUIRE(measured.code == 0);
  CHECK(measured.text.find("30 views") != std::string::npos);
  const Outcome less =
      tool(arguments + " --interference " + at("interference.safetensors") + " --json " + at("less.json"));
  CHECK(less.code != 2);
  CHECK(less.text.find("what the unmarked scene says by itself") != std::string::npos);
  CHECK(json_of(at("less.json"))["interference"]["file"] == "interference.safetensors");
  CHECK(json_of(at("less.json"))["views"][0]["logits"] != json["views"][0]["logits"]);
  CHECK(json.count("interference") == 0);
  check_refused(tool(arguments + " --interference " + s.decoder), {"--interference", "a message decoder"});
  // evaluate reads as verify does, with the file and without.
  const std::string measured_model = "evaluate --data " + at("scene") + " --model " + at("run/model.safetensors"),
                    file = " --interference " + at("interference.safetensors");
  const std::string reader = " --key " + s.key + " --decoder " + s.decoder;
  REQUIRE(tool(measured_model + reader + " --json " + at("with.json")).code == 0);
  REQUIRE(tool(measured_model + reader + file + " --json " + at("without.json")).code == 0);
  CHECK(json_of(at("with.json"))["models"][0]["bits_right"] == json["matches"]);
  CHECK(json_of(at("without.json"))["models"][0]["bits_right"] == json_of(at("less.json"))["matches"]);
  check_refused(tool(measured_model + file), {"interference.safetensors", "--interference", "give --key as well"});
  check_refused(tool(measure + at("run/model.safetensors") + " --out " + s.decoder), {"--out", "lattice.safetensors"});
  check_refused(tool(measure + s.decoder + " --out " + at("x.safetensors")), {"--model", "a message decoder"});
  CHECK(!fs::exists(at("x.safetensors")));
}

TEST_CASE("tool: a carrier decoder is read with the carriers of the key") {
  const Setting& s = setting();
  DecoderWeights weights = random_carrier_network(3, InputConvention{}, 8, 64);
  std::vector<std::vector<float>> pictures;
  for (std::uint64_t i = 0; i < 100; ++i) pictures.push_back(picture(100 + i));
  SerialExecutor executor;
  REQUIRE(calibrate_carriers(
      weights, pictures.size(), [&](std::size_t i) { return view_of(pictures[i]); }, 50, true, executor));
  REQUIRE(write_decoder<SafetensorsWriter>(weights, fs::path(at("carrier.safetensors"))).ok());
  const std::string rest = " --decoder " + at("carrier.safetensors") + " --images " + s.plain;
  check_refused(tool("extract" + rest), {"carrier.safetensors", "carriers", "key"});
  const Outcome one = tool("extract" + rest + " --key " + s.key), two = tool("extract" + rest + " --key " + s.other);
  CHECK(one.code == 0);
  CHECK(two.code == 0);
  CHECK(one.text != two.text);
}

TEST_CASE("tool: a payload is read apart from the verdict, by another key of the same secret too") {
  const Setting& s = setting();
  const Outcome made = tool("keygen --payload 5eed --out " + at("copy1.key"));
  INFO(made.text);
  REQUIRE(made.code == 0);
  REQUIRE(tool("keygen --payload 0002 --from " + at("copy1.key") + " --out " + at("copy2.key")).code == 0);
  CHECK(read_key(at("copy1.key"))->secret == read_key(at("copy2.key"))->secret);
  embed(lattice(), message_of(*read_key(at("copy1.key"))), 2, at("copy1.png"));
  const std::string rest = " --decoder " + s.decoder + " --images " + at("copy1.png");
  const Outcome own = tool("verify --key " + at("copy1.key") + rest + " --json " + at("payload.json") +
                           testing::claimed(at("copy1.key"), s.decoder));
  INFO(own.text);
  CHECK(own.code == 0);
  CHECK(own.text.find("payload     5eed") != std::string::npos);
  CHECK(json_of(at("payload.json"))["payload"]["hex"] == "5eed");
  CHECK(json_of(at("payload.json"))["payload"]["outcome"] == "read");
  CHECK(tool("extract --key " + at("copy2.key") + rest).text.find("payload     5eed") != std::string::npos);
  check_no_mark(tool("verify --key " + at("copy1.key") + " --decoder " + s.decoder + " --images " + s.plain));
  check_refused(tool("keygen --payload 5eed1 --out " + at("x.key")), {"payload", "16 bits of payload, 4 digits"});
  check_refused(tool("keygen --payload xyz0 --out " + at("x.key")), {"payload", "16 bits of payload"});
  check_refused(tool("keygen --payload 00 --corrects 20 --out " + at("x.key")), {"20 bits"});
  check_refused(tool("keygen --bits 128 --payload 00 --out " + at("x.key")), {"128 bits"});
  check_refused(tool("keygen --from " + at("copy1.key") + " --out " + at("x.key")), {"--from", "--payload"});
  CHECK_FALSE(fs::exists(at("x.key")));
}

TEST_CASE("tool: a key is readable by its owner only, never overwritten, and moved aside when that is asked for") {
  const std::string key = at("one.key");
  const Outcome made = tool("keygen --bits 32 --note \"for a test\" --out " + key);
  REQUIRE(made.code == 0);
  const Result<OwnerKey> first = read_key(key);
  REQUIRE(first.ok());
  CHECK(first->bits == 32);
  CHECK(first->note == "for a test");
  CHECK(key_file_is_private(key));
  CHECK(made.text.find(first->commitment()) != std::string::npos);
  CHECK(made.text.find(json_of(key)["secret"].get<std::string>().substr(0, 12)) == std::string::npos);
  check_refused(tool("keygen --out " + key), {"one.key", "exists", "--force"});
  CHECK(read_key(key)->secret == first->secret);
  REQUIRE(tool("keygen --force --out " + key).code == 0);
  CHECK(read_key(key)->secret != first->secret);
  const Result<OwnerKey> old = read_key(key + "." + first->id() + ".old");
  REQUIRE(old.ok());
  CHECK(old->secret == first->secret);
  REQUIRE(write_file(at("not-a-key"), std::string_view("precious")).ok());
  check_refused(tool("keygen --force --out " + at("not-a-key")), {"not-a-key", "not a whole key"});
  CHECK(read_file(at("not-a-key"))->size() == 8);
  check_refused(tool("keygen --bits 0 --out " + at("x.key")), {"bits"});
  check_refused(tool("keygen --bits 129 --out " + at("x.key")), {"bits", "128"});
  check_refused(tool("keygen --out " + at("no/such/folder/x.key")), {"no/such/folder", "create this folder"});
  CHECK_FALSE(fs::exists(at("x.key")));
  const Outcome brief = tool("keygen --bits 16 --out " + at("brief.key"));
  CHECK(brief.code == 0);
  CHECK(brief.text.find("warning: 16 bits can never be evidence") != std::string::npos);
}

TEST_CASE("tool: bad input of extract, verify and calibrate is one error line, and no report is touched") {
  const Setting& s = setting();
  const std::string report = at("report.json");
  REQUIRE(write_file(report, std::string_view("an older report")).ok());
  const auto verify = [&](const std::string& key, const std::string& decoder, const std::string& input) {
    return tool("verify --key " + key + " --decoder " + decoder + " " + input + " --json " + report);
  };
  const std::string images = "--images " + s.marked;

  // Keys.
  check_refused(verify(at("missing.key"), s.decoder, images), {"missing.key", "no such file"});
  REQUIRE(tool("keygen --bits 32 --out " + at("short.key")).code == 0);
  check_refused(verify(at("short.key"), s.decoder, images), {"lattice.safetensors", "48 bits", "32"});
  fs::copy_file(s.key, at("cut.key"), fs::copy_options::overwrite_existing);
  fs::resize_file(at("cut.key"), 120);
  fs::permissions(at("cut.key"), fs::perms::owner_read | fs::perms::owner_write);
  check_refused(verify(at("cut.key"), s.decoder, images), {"cut.key"});
  check_refused(verify(s.decoder, s.decoder, images), {"lattice.safetensors"});

  // Decoders.
  check_refused(verify(s.key, at("missing.safetensors"), images), {"missing.safetensors", "no such file"});
  const std::uintmax_t size = fs::file_size(s.decoder);
  for (const std::uintmax_t kept : {std::uintmax_t{0}, std::uintmax_t{7}, std::uintmax_t{200}, size / 2, size - 1}) {
    fs::copy_file(s.decoder, at("cut.safetensors"), fs::copy_options::overwrite_existing);
    fs::resize_file(at("cut.safetensors"), kept);
    check_refused(verify(s.key, at("cut.safetensors"), images), {"cut.safetensors", ";"});
    check_refused(tool("extract --decoder " + at("cut.safetensors") + " " + images), {"cut.safetensors", ";"});
    check_refused(tool("calibrate --decoder " + at("cut.safetensors") + " " + images), {"cut.safetensors", ";"});
  }
  std::vector<std::byte> bytes = *read_file(s.decoder);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + bytes.size() - 400, &nan, sizeof nan);
  REQUIRE(write_file(at("nan.safetensors"), std::span<const std::byte>(bytes)).ok());
  check_refused(verify(s.key, at("nan.safetensors"), images), {"nan.safetensors", "damaged"});
  REQUIRE(write_lattice<SafetensorsWriter>(lattice(32), "", fs::path(at("lattice32.safetensors"))).ok());
  check_refused(verify(s.key, at("lattice32.safetensors"), images), {"lattice32.safetensors", "32 bits", "48"});
  check_refused(verify(s.key, s.marked + "/image0.png", images), {"image0.png"});

  // Images.
  check_refused(verify(s.key, s.decoder, ""), {"--model, --images"});
  check_refused(verify(s.key, s.decoder, "--images " + at("nowhere")), {"nowhere", "no such file or folder"});
  fs::create_directories(at("empty"));
  check_refused(verify(s.key, s.decoder, "--images " + at("empty")), {"empty", "no PNG or JPEG"});
  check_refused(tool("extract --decoder " + s.decoder + " --images " + at("empty")), {"empty", "no PNG or JPEG"});
  check_refused(verify(s.key, s.decoder, "--images " + s.marked + "/notes.txt"), {"notes.txt", "not an image"});
  fs::copy_file(s.marked + "/image0.png", at("cut.png"), fs::copy_options::overwrite_existing);
  fs::resize_file(at("cut.png"), fs::file_size(at("cut.png")) / 2);
  check_refused(verify(s.key, s.decoder, "--images " + s.marked + " " + at("cut.png")), {"cut.png"});
  const std::vector<float> tiny(3 * 4 * 40, 0.5f);
  REQUIRE(write_png(at("tiny.png"), ImageView<const float>{tiny.data(), 3, 4, 40}).ok());
  check_refused(verify(s.key, s.decoder, "--images " + at("tiny.png")), {"tiny.png", "40 x 4", "at least 8 pixels"});
  ImageBytes clear{side, side, 4, std::vector<std::uint8_t>(4 * side * side, 128)};
  REQUIRE(write_png(at("clear.png"), clear).ok());
  // Transparent pixels are black unless another colour is said.
  const auto read_over = [&](const std::string& colour) {
    const Outcome outcome = tool("verify" + s.with(at("clear.png")) + colour + " --json " + at("clear.json"));
    CHECK(outcome.code != 2);
    return json_of(at("clear.json"))["views"][0]["logits"];
  };
  CHECK(read_over("") == read_over(" --background black"));
  CHECK(read_over("") == read_over(" --background 000000"));
  CHECK(read_over(" --background white") == read_over(" --background '#FFFFFF'"));
  CHECK(read_over("") != read_over(" --background white"));
  for (const std::string colour : {"green", "12345", "12345g", "1234567"}) {
    check_refused(verify(s.key, s.decoder, "--images " + at("clear.png") + " --background " + colour),
                  {"--background", colour, "RRGGBB"});
  }

  // Models and settings.
  check_refused(verify(s.key, s.decoder, "--model " + at("no-model.safetensors")), {"no-model.safetensors"});
  check_refused(verify(s.key, s.decoder, "--model " + s.decoder), {"lattice.safetensors"});
  check_refused(verify(s.key, s.decoder, images + " --alpha 0"), {"--alpha", "above 0"});
  check_refused(verify(s.key, s.decoder, images + " --alpha 2"), {"--alpha", "up to 1"});
  check_refused(verify(s.key, s.decoder, images + " --tests 0"), {"--tests", "from 1"});
  check_refused(verify(s.key, s.decoder, images + " --tests 1000000000000001"), {"--tests", "from 1"});
  CHECK(verify(s.key, s.decoder, images + " --model " + at("m.safetensors")).code == 2);
  CHECK(tool("verify --decoder " + s.decoder + " " + images).code == 2);
  CHECK(read_file(report)->size() == 15);  // "an older report"
  check_refused(tool("verify" + s.with(s.marked) + " --json " + at("no/such/report.json")), {"report.json"});
  check_refused(tool("calibrate --decoder " + s.decoder + " " + images + " --json " + at("no/such/null.json")),
                {"null.json"});

  fs::permissions(s.other, fs::perms::others_read, fs::perm_options::add);
  CHECK(tool("verify --key " + s.other + " --decoder " + s.decoder + " " + images).text.find("warning") !=
        std::string::npos);
  fs::permissions(s.other, fs::perms::owner_read | fs::perms::owner_write);
}

TEST_CASE("tool: what a cheat can make is no proof: a decoder, a key that was tried, a claim of it") {
  const Setting& s = setting();
  const std::string words = " --key " + s.key + " --images ", file = s.claim.substr(std::string(" --claim ").size());
  const auto proof = [&](const std::string& arguments, int code) {
    const Outcome outcome = tool("verify" + arguments + " --json " + at("standing.json"));
    INFO(outcome.text);
    CHECK(outcome.code == code);
    const nlohmann::json json = json_of(at("standing.json"));
    CHECK((outcome.text.find("\nNOT A PROOF: ") != std::string::npos) == (json["proof"]["standing"] == "not_a_proof"));
    CHECK((outcome.text.find("DETECTED, a proof") != std::string::npos) == (json["proof"]["standing"] == "proof"));
    CHECK((outcome.text.find("DETECTED, conditionally") != std::string::npos) ==
          (json["proof"]["standing"] == "conditional"));
    return json;
  };

  // Without a claim, a decoder that nobody published reads what its maker wants.
  nlohmann::json json = proof(words + s.marked + " --decoder " + s.decoder, 3);
  CHECK(json["verdict"] == "detected");
  CHECK(json["proof"]["reason"].get<std::string>().find("this decoder could have been made for these pictures") == 0);
  // The decoder turned round: rows of the claimed one negated until unmarked pictures say the thief's message.
  LatticeDecoder<float> network = lattice();
  const Outcome read = tool("extract --decoder " + s.decoder + " --images " + s.plain + " --json " + at("said.json"));
  REQUIRE(read.code == 0);
  const Message said = *Message::from_hex(json_of(at("said.json"))["hex"].get<std::string>(), 48),
                wanted = message_of(*read_key(s.key));
  LatticeWeights<float> weights = network.weights();
  for (std::size_t b = 0; b < 48; ++b) {
    if (said[b] == wanted[b]) continue;
    for (float* const row = weights.head.data() + b * weights.head.size() / 48;
         float& value : std::span(row, weights.head.size() / 48))
      value = -value;
    weights.bias[b] = -weights.bias[b];
  }
  REQUIRE(write_lattice<SafetensorsWriter>(LatticeDecoder<float>(network.settings(), weights), "",
                                           fs::path(at("turned.safetensors")))
              .ok());
  json = proof(words + s.plain + " --decoder " + at("turned.safetensors") + s.claim, 3);
  CHECK(json["matches"] == 48);
  CHECK(json["proof"]["decoder"] == "unknown");

  // Claimed after the key, it is one that nobody has to believe: the report says on what it depends.
  REQUIRE(
      tool("claim --key " + s.key + " --decoder " + at("turned.safetensors") + " --out " + at("turned.claim")).code ==
      0);
  json = proof(words + s.plain + " --decoder " + at("turned.safetensors") + " --claim " + at("turned.claim"), 0);
  CHECK(json["proof"]["standing"] == "conditional");
  CHECK(json["proof"]["reason"].get<std::string>().find("if the decoder was made without") != std::string::npos);
  // A claim that is there is not written over by another one; the same one may be written again.
  check_refused(tool("claim --key " + s.key + " --decoder " + s.decoder + " --out " + at("turned.claim")),
                {"turned.claim", "--out", "says something else"});
  CHECK(tool("claim --key " + s.key + " --decoder " + at("turned.safetensors") + " --out " + at("turned.claim")).code ==
        0);

  // Keys are tried until one fits: with a shipped decoder, unmarked pictures and keys of version 1, a microsecond each.
  const Outcome shipped =
      tool("extract --decoder weights/lattice_48.safetensors --images " + s.plain + " --json " + at("said.json"));
  REQUIRE(shipped.code == 0);
  const Message bits = *Message::from_hex(json_of(at("said.json"))["hex"].get<std::string>(), 48);
  OwnerKey best = *read_key(s.key);
  std::size_t most = 0;
  for (std::uint32_t i = 1; i < 40'000; ++i) {
    Digest256 secret{};
    std::memcpy(secret.data(), &i, sizeof i);
    const OwnerKey key = *make_key(secret, "2020-01-01T00:00:00Z", 48);
    if (const std::size_t same = message_of(key).matches(bits); same > most) {
      most = same;
      best = key;
    }
  }
  MESSAGE("of 40,000 keys, one matches ", most, " of 48");
  CHECK(most >= *match_threshold(48, 1e-3));
  REQUIRE(write_key(at("ground.key"), best).ok());
  const std::string ground =
      " --decoder weights/lattice_48.safetensors --alpha 1e-3 --key " + at("ground.key") + " --images " + s.plain;
  json = proof(ground, 3);
  CHECK(json["verdict"] == "detected");
  CHECK(json["proof"]["decoder"] == "shipped");
  CHECK(json["proof"]["reason"].get<std::string>().find("somebody could have tried keys") == 0);
  CHECK(json["proof"]["p_value_if_tried"] == 1.0);

  // A claim is of one key; its time stamp is of this claim; a claim that was changed is none.
  check_refused(tool("verify --key " + s.other + " --images " + s.marked + " --decoder " + s.decoder + s.claim),
                {"owner.key.claim", "key", "not the commitment of this key"});
  check_refused(tool("verify" + s.with(s.marked) + " --time-stamp tests/golden/claim/owner.tsr"),
                {"owner.tsr", "another file than the claim"});
  check_refused(tool("verify" + s.with(s.marked) + " --time-stamp " + file), {"owner.key.claim", "not a time stamp"});
  check_refused(
      tool("verify" + words + s.marked + " --decoder " + s.decoder + " --time-stamp tests/golden/claim/owner.tsr"),
      {"--time-stamp", "without a claim"});
  std::string text = testing::text_of(file);
  text[30] = text[30] == '0' ? '1' : '0';
  REQUIRE(write_file(at("changed.claim"), text).ok());
  check_refused(tool("verify" + words + s.marked + " --decoder " + s.decoder + " --claim " + at("changed.claim")),
                {"changed.claim", "not the commitment of this key"});
  check_refused(tool("claim --key " + s.key + " --decoder " + s.key + " --out " + at("none.claim")), {"owner.key"});
  check_refused(tool("claim --key " + s.key + " --decoder " + s.decoder + " --unmarked " + s.decoder + " --out " +
                     at("none.claim")),
                {"lattice.safetensors", "--unmarked"});
  CHECK_FALSE(fs::exists(at("none.claim")));
}

TEST_CASE("tool: a decoder that is made after a bound key is refused, and bound to it the secret is another message") {
  const Setting& s = setting();
  const Outcome made = tool("keygen --bits 48 --decoder " + s.decoder + " --out " + at("bound.key"));
  REQUIRE(made.code == 0);
  CHECK(made.text.find("compmark claim --key " + at("bound.key") + " --decoder " + s.decoder) != std::string::npos);
  const OwnerKey key = *read_key(at("bound.key"));
  CHECK(key.version() == 5);
  const Outcome plain = tool("verify --key " + at("bound.key") + " --decoder " + s.decoder + " --images " + s.plain +
                             " --json " + at("b.json"));
  CHECK(plain.code == 1);
  CHECK(json_of(at("b.json"))["proof"]["decoder"] == "bound");
  // A decoder that says the key's message of every picture: only its biases count.
  LatticeWeights<float> weights = lattice().weights();
  const Message wanted = message_of(key);
  std::fill(weights.head.begin(), weights.head.end(), 0.f);
  for (std::size_t b = 0; b < 48; ++b) weights.bias[b] = wanted[b] ? 1.f : -1.f;
  REQUIRE(write_lattice<SafetensorsWriter>(LatticeDecoder<float>(lattice().settings(), weights), "",
                                           fs::path(at("says.safetensors")))
              .ok());
  check_refused(
      tool("verify --key " + at("bound.key") + " --decoder " + at("says.safetensors") + " --images " + s.plain),
      {"says.safetensors", "not the decoder that this key is bound to"});
  // The same secret bound to it has another message, which the decoder does not say.
  const OwnerKey tried =
      *make_bound_key(key.secret, *file_sha256(at("says.safetensors")), key.created, 48, "", OwnerKey::least_hardness);
  REQUIRE(write_key(at("tried.key"), tried).ok());
  const Outcome other = tool("verify --key " + at("tried.key") + " --decoder " + at("says.safetensors") + " --images " +
                             s.plain + " --json " + at("b.json"));
  CHECK(other.code == 1);
  CHECK(json_of(at("b.json"))["verdict"] == "not_detected");
  // Negative control: a key that is bound to nothing is read by a decoder that says its message.
  for (std::size_t b = 0; b < 48; ++b) weights.bias[b] = message_of(*read_key(s.key))[b] ? 1.f : -1.f;
  REQUIRE(write_lattice<SafetensorsWriter>(LatticeDecoder<float>(lattice().settings(), weights), "",
                                           fs::path(at("says.safetensors")))
              .ok());
  const Outcome fooled = tool("verify --any-decoder --key " + s.key + " --decoder " + at("says.safetensors") +
                              " --images " + s.plain + " --json " + at("b.json"));
  CHECK(fooled.code == 3);  // detected, and not a proof
  CHECK(json_of(at("b.json"))["matches"] == 48);
}

TEST_CASE("tool: keygen makes keys that take their time to derive, and quick ones where that is asked for") {
  REQUIRE(tool("keygen --out " + at("hard.key")).code == 0);
  CHECK(json_of(at("hard.key"))["version"] == 5);
  CHECK(json_of(at("hard.key"))["hardness"] == 17);
  REQUIRE(tool("keygen --quick --out " + at("quick.key")).code == 0);
  CHECK(json_of(at("quick.key"))["version"] == 1);
  const Outcome claim = tool("claim --key " + at("hard.key") + " --out " + at("hard.claim"));
  REQUIRE(claim.code == 0);
  const Result<OwnerClaim> read = read_claim(at("hard.claim"));
  REQUIRE(read.ok());
  CHECK(read->key == read_key(at("hard.key"))->commitment());
  CHECK(shipped_decoder_of(read->decoder)->name == "universal3_64");
  CHECK(claim.text.find(to_hex(read->digest())) != std::string::npos);
}

}  // namespace verify_test
