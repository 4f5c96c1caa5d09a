// Tools > Light from a Photo puts a photo's light into the open scene, for HDRP or URP of Unity 6: that of the selected
// folder in Assets/LightFromPhoto, else of the one imported last. Running it again replaces what it made. Meters; +Y is
// up, the photo's camera looks along +Z, and +X is to its right.
using System;
using System.IO;
using System.Linq;
using UnityEditor;
using UnityEngine;
using UnityEngine.Rendering;
#if LIGHT_FROM_PHOTO_HDRP
using UnityEngine.Rendering.HighDefinition;
#endif

namespace LightFromPhoto
{
    [Serializable]
    public class SceneNumbers
    {
        public float verticalFov, aspect, near, far;
        public Vector3 cameraPosition;
        public Quaternion cameraRotation, sunRotation;
        public Color sunColor; // as sRGB
        public float sunIrradiance, sunAngle;
        public bool sunReachesObject; // false: the spot lies in the photo's shade, and the sun is off
        public float[] ringMeans; // RGB of the map's four upright cube faces: ahead, right, behind, left
        public float[] groundPoints, groundPlaces; // x, y, z and u, v of the ground that the picture shows
        public int[] groundTriangles;
        public Vector3 spot, ballCenter, stickCenter;
        public float ballRadius, stickRadius, stickHeight, albedo;
    }

    public static class SceneBuilder
    {
        const string Photos = "Assets/LightFromPhoto";
        const string Name = "Light from a Photo";
        const float BackdropShare = 0.9f; // its distance / the far clipping distance
        static string folder; // of the photo whose light it is

        [MenuItem("Tools/Light from a Photo")]
        public static void Build()
        {
            if (PlayerSettings.colorSpace != ColorSpace.Linear)
                Debug.LogWarning("The project's color space is not Linear (Player settings): the light will be wrong.");
            folder = ChooseFolder();
            var numbers = JsonUtility.FromJson<SceneNumbers>(Load<TextAsset>("scene.json").text);
            var last = GameObject.Find(Name);
            if (last != null) Undo.DestroyObjectImmediate(last);
            foreach (var other in UnityEngine.Object.FindObjectsByType<Light>(FindObjectsSortMode.None))
                Debug.LogWarning("The scene has another light, which shines beside the photo's: " + other.name, other);
            var root = new GameObject(Name);
            Undo.RegisterCreatedObjectUndo(root, Name);
            AddSky(root.transform, numbers);
            AddSun(root.transform, numbers);
            AddBackdrop(AddCamera(root.transform, numbers), numbers);
            AddGround(root.transform, numbers);
            AddPlaceholder(root.transform, numbers);
        }

        static string ChooseFolder()
        {
            var folders = AssetDatabase.GetSubFolders(Photos).Where(path => File.Exists(path + "/scene.json")).ToArray();
            if (folders.Length == 0) throw new InvalidOperationException("Import a photo's scene.unitypackage first.");
            var selected = AssetDatabase.GetAssetPath(Selection.activeObject) + "/";
            var chosen = folders.FirstOrDefault(path => selected.StartsWith(path + "/"))
                ?? folders.OrderBy(path => File.GetLastWriteTimeUtc(path + "/scene.json")).Last();
            return chosen + "/";
        }

        static T Load<T>(string name) where T : UnityEngine.Object
        {
            return AssetDatabase.LoadAssetAtPath<T>(folder + name);
        }

        static Transform Add(string name, Transform parent, Vector3 position, Quaternion rotation)
        {
            var made = new GameObject(name).transform;
            made.SetParent(parent);
            made.SetPositionAndRotation(position, rotation);
            return made;
        }

        // Light.

        // In HDRP the intensity is lux. URP leaves the 1 / pi of diffuse surfaces to the light.
        static void AddSun(Transform root, SceneNumbers numbers)
        {
            var light = Add("Sun", root, Vector3.zero, numbers.sunRotation).gameObject.AddComponent<Light>();
            light.type = LightType.Directional;
            light.useColorTemperature = false;
            light.color = numbers.sunColor;
            light.shadows = LightShadows.Soft;
#if LIGHT_FROM_PHOTO_HDRP
            var data = light.gameObject.AddComponent<HDAdditionalLightData>();
            HDAdditionalLightData.InitDefaultHDAdditionalLightData(data);
            light.lightUnit = LightUnit.Lux;
            light.intensity = numbers.sunIrradiance;
            data.angularDiameter = numbers.sunAngle;
            data.EnableShadows(true);
#else
            light.intensity = numbers.sunIrradiance / Mathf.PI;
#endif
            light.enabled = numbers.sunReachesObject;
        }

        static void AddSky(Transform root, SceneNumbers numbers)
        {
            var cubemap = Load<Cubemap>("environment.exr");
            var rotation = SkyRotation(cubemap, numbers.ringMeans);
#if LIGHT_FROM_PHOTO_HDRP
            var volume = Add("Sky and Exposure", root, Vector3.zero, Quaternion.identity).gameObject.AddComponent<Volume>();
            volume.isGlobal = true;
            volume.sharedProfile = NewProfile();
            var environment = volume.sharedProfile.Add<VisualEnvironment>(true);
            environment.skyType.Override((int)SkyType.HDRI);
            environment.skyAmbientMode.Override(SkyAmbientMode.Dynamic);
            var sky = volume.sharedProfile.Add<HDRISky>(true);
            sky.hdriSky.Override(cubemap);
            sky.rotation.Override(rotation);
            sky.skyIntensityMode.Override(SkyIntensityMode.Multiplier);
            sky.multiplier.Override(1f);
            var exposure = volume.sharedProfile.Add<Exposure>(true);
            exposure.mode.Override(ExposureMode.Fixed);
            exposure.fixedExposure.Override(-Mathf.Log(1.2f, 2f)); // HDRP divides by 1.2 x 2^EV
            volume.sharedProfile.Add<Tonemapping>(true).mode.Override(TonemappingMode.None);
            SaveProfile(volume.sharedProfile);
#else
            var material = NewMaterial("Sky", "Skybox/Cubemap");
            material.SetTexture("_Tex", cubemap);
            material.SetFloat("_Rotation", rotation);
            material.SetFloat("_Exposure", 1f);
            material.SetColor("_Tint", new Color(1f / 4.5947938f, 1f / 4.5947938f, 1f / 4.5947938f).gamma); // its doubling
            RenderSettings.skybox = material;
            RenderSettings.ambientMode = AmbientMode.Skybox;
            RenderSettings.ambientIntensity = 1f;
            RenderSettings.defaultReflectionMode = DefaultReflectionMode.Skybox;
            RenderSettings.reflectionIntensity = 1f;
            DynamicGI.UpdateEnvironment();
#endif
        }

        // The yaw that puts the map's center at +Z, whichever face the importer gave it: the faces' means tell.
        static float SkyRotation(Cubemap cubemap, float[] ringMeans)
        {
            var ring = new[] { CubemapFace.PositiveZ, CubemapFace.PositiveX, CubemapFace.NegativeZ, CubemapFace.NegativeX };
            var means = ring.Select(face => cubemap.GetPixels(face, cubemap.mipmapCount - 1)[0]).ToArray();
            var errors = Enumerable.Range(0, 4).Select(turn => Enumerable.Range(0, 4).Sum(side =>
            {
                var mean = means[(side + turn) % 4];
                return Mathf.Abs(mean.r - ringMeans[3 * side]) + Mathf.Abs(mean.g - ringMeans[3 * side + 1])
                    + Mathf.Abs(mean.b - ringMeans[3 * side + 2]);
            })).ToArray();
            return 90f * Array.IndexOf(errors, errors.Min());
        }

        // Camera, photo, ground.

        static Camera AddCamera(Transform root, SceneNumbers numbers)
        {
            var camera = Add("Camera", root, numbers.cameraPosition, numbers.cameraRotation).gameObject.AddComponent<Camera>();
            camera.usePhysicalProperties = false;
            camera.fieldOfView = numbers.verticalFov;
            camera.nearClipPlane = numbers.near;
            camera.farClipPlane = numbers.far;
#if LIGHT_FROM_PHOTO_HDRP
            camera.gameObject.AddComponent<HDAdditionalCameraData>();
#endif
            return camera;
        }

        static void AddBackdrop(Camera camera, SceneNumbers numbers)
        {
            var distance = BackdropShare * numbers.far;
            var height = 2f * distance * Mathf.Tan(Mathf.Deg2Rad * numbers.verticalFov / 2f);
            var quad = GameObject.CreatePrimitive(PrimitiveType.Quad);
            quad.name = "Backdrop";
            quad.transform.SetParent(camera.transform, false);
            quad.transform.localPosition = new Vector3(0f, 0f, distance);
            quad.transform.localScale = new Vector3(height * numbers.aspect, height, 1f);
#if LIGHT_FROM_PHOTO_HDRP
            Dress(quad, NewMaterial("Backdrop", "HDRP/Unlit", ("_UnlitColorMap", "plate.png")), false);
#else
            Dress(quad, NewMaterial("Backdrop", "Universal Render Pipeline/Unlit", ("_BaseMap", "plate.png")), false);
#endif
        }

        static void AddGround(Transform root, SceneNumbers numbers)
        {
            var mesh = new Mesh { name = "Ground", indexFormat = IndexFormat.UInt32 };
            mesh.vertices = Enumerable.Range(0, numbers.groundPoints.Length / 3).Select(i => new Vector3(
                numbers.groundPoints[3 * i], numbers.groundPoints[3 * i + 1], numbers.groundPoints[3 * i + 2])).ToArray();
            mesh.uv = Enumerable.Range(0, numbers.groundPlaces.Length / 2).Select(i => new Vector2(
                numbers.groundPlaces[2 * i], numbers.groundPlaces[2 * i + 1])).ToArray();
            mesh.triangles = numbers.groundTriangles;
            mesh.normals = Enumerable.Repeat(Vector3.up, mesh.vertexCount).ToArray();
            mesh.RecalculateBounds();
            var ground = Add("Ground", root, Vector3.zero, Quaternion.identity).gameObject;
            ground.AddComponent<MeshFilter>().sharedMesh = Save(mesh, "Ground.asset");
            ground.AddComponent<MeshRenderer>();
            var material = NewLit("Ground", Color.white);
#if LIGHT_FROM_PHOTO_HDRP
            material.SetTexture("_BaseColorMap", Load<Texture2D>("ground_albedo.png"));
            material.SetTexture("_EmissiveColorMap", Load<Texture2D>("ground_emission.png"));
            material.SetColor("_EmissiveColor", Color.white);
            material.SetFloat("_EmissiveExposureWeight", 1f);
            HDMaterial.ValidateMaterial(material);
#else
            material.SetTexture("_BaseMap", Load<Texture2D>("ground_albedo.png"));
            material.SetTexture("_EmissionMap", Load<Texture2D>("ground_emission.png"));
            material.SetColor("_EmissionColor", Color.white);
            material.EnableKeyword("_EMISSION");
#endif
            Dress(ground, material, false);
        }

        static void AddPlaceholder(Transform root, SceneNumbers numbers)
        {
            var spot = Add("Your object here", root, numbers.spot, Quaternion.identity);
            var gray = NewLit("Placeholder", new Color(numbers.albedo, numbers.albedo, numbers.albedo).gamma);
            var ball = GameObject.CreatePrimitive(PrimitiveType.Sphere);
            var stick = GameObject.CreatePrimitive(PrimitiveType.Cylinder); // 2 units tall, 1 wide
            ball.name = "Ball";
            stick.name = "Stick";
            foreach (var thing in new[] { ball, stick }) thing.transform.SetParent(spot, false);
            ball.transform.localPosition = numbers.ballCenter;
            ball.transform.localScale = 2f * numbers.ballRadius * Vector3.one;
            stick.transform.localPosition = numbers.stickCenter;
            stick.transform.localScale =
                new Vector3(2f * numbers.stickRadius, numbers.stickHeight / 2f, 2f * numbers.stickRadius);
            Dress(ball, gray, true);
            Dress(stick, gray, true);
        }

        // Assets.

        static Material NewLit(string name, Color color)
        {
#if LIGHT_FROM_PHOTO_HDRP
            var material = NewMaterial(name, "HDRP/Lit");
            material.SetFloat("_MaterialID", 4f); // specular color, which is black
            material.SetColor("_SpecularColor", Color.black);
#else
            var material = NewMaterial(name, "Universal Render Pipeline/Lit");
            material.SetFloat("_SpecularHighlights", 0f);
            material.SetFloat("_EnvironmentReflections", 0f);
            material.EnableKeyword("_SPECULARHIGHLIGHTS_OFF");
            material.EnableKeyword("_ENVIRONMENTREFLECTIONS_OFF");
#endif
            material.SetColor("_BaseColor", color);
            material.SetFloat("_Smoothness", 0f);
#if LIGHT_FROM_PHOTO_HDRP
            HDMaterial.ValidateMaterial(material);
#endif
            return material;
        }

        static Material NewMaterial(string name, string shader, params (string property, string picture)[] pictures)
        {
            var found = Shader.Find(shader);
            if (found == null) throw new InvalidOperationException("This project has no shader " + shader + ".");
            var material = new Material(found);
            foreach (var entry in pictures) material.SetTexture(entry.property, Load<Texture2D>(entry.picture));
            return Save(material, name + ".mat");
        }

        static T Save<T>(T asset, string name) where T : UnityEngine.Object
        {
            AssetDatabase.DeleteAsset(folder + name);
            AssetDatabase.CreateAsset(asset, folder + name);
            return asset;
        }

        static void Dress(GameObject thing, Material material, bool castsShadow)
        {
            var collider = thing.GetComponent<Collider>();
            if (collider != null) UnityEngine.Object.DestroyImmediate(collider);
            var renderer = thing.GetComponent<MeshRenderer>();
            renderer.sharedMaterial = material;
            renderer.shadowCastingMode = castsShadow ? ShadowCastingMode.On : ShadowCastingMode.Off;
            renderer.receiveShadows = true;
        }

#if LIGHT_FROM_PHOTO_HDRP
        static VolumeProfile NewProfile()
        {
            return Save(ScriptableObject.CreateInstance<VolumeProfile>(), "Sky and Exposure.asset");
        }

        static void SaveProfile(VolumeProfile profile)
        {
            foreach (var component in profile.components) AssetDatabase.AddObjectToAsset(component, profile);
            EditorUtility.SetDirty(profile);
            AssetDatabase.SaveAssets();
        }
#endif
    }
}
