#include "tools/viewer/function_chooser.h"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

using For = FunctionChooser::For;

class FunctionChooserTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {24, 12, 12}), *folder_ / "scene.splats");
  }
  static void TearDownTestSuite() { folder_.reset(); }

  /// What is answered until nothing is to come.
  static std::vector<FunctionChooser::Question> answersOf(FunctionChooser& chooser) {
    std::vector<FunctionChooser::Question> answers;
    while (chooser.busy()) {
      if (const auto answer = chooser.take()) answers.push_back(answer->question);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return answers;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  const CacheReader cache_{*folder_ / "scene.splats"};
  const std::string scalar_ = cache_.manifest().variables.front().name;
  FunctionChooser chooser_{cache_, [] {}};
};
std::unique_ptr<TemporaryFolder> FunctionChooserTest::folder_;

TEST_F(FunctionChooserTest, AQuestionForOnePurposeDropsNoneForAnother) {
  chooser_.ask({For::kScalar, scalar_});
  chooser_.ask({For::kOpacities, scalar_});
  EXPECT_EQ(answersOf(chooser_),
            (std::vector<FunctionChooser::Question>{{For::kScalar, scalar_}, {For::kOpacities, scalar_}}));
}

TEST_F(FunctionChooserTest, OfOnePurposeTheNewestIsAnswered) {
  chooser_.ask({For::kScalar, "a scalar that would be an error"});
  chooser_.ask({For::kScalar, scalar_});
  EXPECT_EQ(answersOf(chooser_), (std::vector<FunctionChooser::Question>{{For::kScalar, scalar_}}));
}

TEST_F(FunctionChooserTest, WhatIsDroppedIsNotAnswered) {
  chooser_.ask({For::kOpacities, scalar_});
  chooser_.ask({For::kSameScalar, scalar_});
  chooser_.drop(For::kOpacities);
  EXPECT_EQ(answersOf(chooser_), (std::vector<FunctionChooser::Question>{{For::kSameScalar, scalar_}}));
  chooser_.ask({For::kScalar, scalar_});
  chooser_.drop();
  EXPECT_FALSE(chooser_.busy());
  EXPECT_FALSE(chooser_.take());
}

TEST_F(FunctionChooserTest, AnErrorEndsItsQuestionOnly) {
  chooser_.ask({For::kScalar, "no scalar"});
  chooser_.ask({For::kOpacities, scalar_});
  EXPECT_THROW(answersOf(chooser_), Error);
  EXPECT_EQ(answersOf(chooser_), (std::vector<FunctionChooser::Question>{{For::kOpacities, scalar_}}));
}

/// Of a view that is replaced while it chooses.
TEST_F(FunctionChooserTest, AnotherTakesItsQuestions) {
  FunctionChooser next(cache_, [] {});
  chooser_.ask({For::kScalar, scalar_});
  chooser_.ask({For::kOpacities, scalar_});
  next.takeQuestionsOf(chooser_);
  EXPECT_FALSE(chooser_.busy());
  EXPECT_EQ(answersOf(next),
            (std::vector<FunctionChooser::Question>{{For::kScalar, scalar_}, {For::kOpacities, scalar_}}));
}

}  // namespace
}  // namespace curvisplat
